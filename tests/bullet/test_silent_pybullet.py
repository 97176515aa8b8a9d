"""The import of PyBullet writes nothing to the terminal, and later output is not lost."""

import subprocess
import sys

CODE = """
import sys
print("before", flush=True)
import msrr_bullet.sweep.sweep
import msrr_bullet.trial.trial
assert "pybullet" in sys.modules
print("after")
print("error", file=sys.stderr)
"""


def test_pybullet_is_imported_silently() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("before\nafter\n", "error\n")
