"""A module of a user's own that was edited, or lies in another folder, is never taken for the older one."""

from __future__ import annotations

import importlib
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from msrr_scenes.errors import ChangedFileError
from msrr_scenes.own_modules import digest_of, import_own

OLDER, NEWER = "from edited_gains import GAIN\nclass Law:\n    gain = GAIN\n", "class Law:\n    gain = 3\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with a module that imports another one."""
    home = tmp_path / "one"
    home.mkdir()
    (home / "edited_own.py").write_text(OLDER)
    (home / "edited_gains.py").write_text("GAIN = 1\n")
    monkeypatch.chdir(home)
    monkeypatch.syspath_prepend(home)
    for name in ("edited_own", "edited_gains"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return home


def test_a_module_that_stays_as_it_is_is_the_same_object(folder: Path) -> None:
    module = import_own("edited_own")
    assert import_own("edited_own") is module
    assert digest_of("edited_own") == digest_of("edited_own", imported=True)


@pytest.mark.parametrize("name", ["edited_own", "edited_gains"])
def test_one_that_was_edited_is_refused_until_it_is_reloaded(folder: Path, name: str) -> None:
    """Also where it is a module that it imports; of another length, by which Python tells files."""
    module, before = import_own("edited_own"), digest_of("edited_own")
    (folder / f"{name}.py").write_text(
        NEWER
        if name == "edited_own"
        else "GAIN = 3  # of another length, for Python compares its files by that\n"
    )
    with pytest.raises(ChangedFileError, match=r"^edited_own\.py, or a module that it imports, was edited"):
        import_own("edited_own")
    assert digest_of("edited_own", imported=True) == before
    importlib.invalidate_caches()
    for edited in dict.fromkeys((name, "edited_own")):
        importlib.reload(sys.modules[edited])
    assert import_own("edited_own") is module
    assert module.Law.gain == 3
    assert digest_of("edited_own", imported=True) == digest_of("edited_own") != before


def test_one_that_changes_the_working_folder_changes_it_for_no_one_else(folder: Path, tmp_path: Path) -> None:
    """Runs and stores of sweeps were written there, and their paths were told as if they were here."""
    (folder / "edited_own.py").write_text(f"import os\nos.chdir({str(tmp_path)!r})\n")
    import_own("edited_own")
    assert Path.cwd() == folder


def test_one_of_another_folder_is_refused(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import_own("edited_own")
    other = tmp_path / "two"
    other.mkdir()
    (other / "edited_own.py").write_text(NEWER)
    monkeypatch.syspath_prepend(other)
    with pytest.raises(
        ChangedFileError, match=rf"is {other}/edited_own\.py here, and .* {folder}/edited_own"
    ):
        import_own("edited_own")


def test_the_file_of_a_program_is_that_of_its_classes(tmp_path: Path) -> None:
    """A class is named ``__main__:Law`` there; what the program imports counts as well."""
    program, gains = tmp_path / "study.py", tmp_path / "study_gains.py"
    program.write_text(
        "import study_gains\nfrom msrr_scenes.own_modules import digest_of\n"
        "if __name__ == '__main__': print(digest_of('__main__').hex())\n"
    )
    digests = set()
    for arguments in ([str(program)], ["-m", "study"]):
        for gain in (1, 20):
            gains.write_text(f"GAIN = {gain}\n")
            digests.add((arguments[0], printed_by(arguments, tmp_path)))
        program.write_text(program.read_text() + "# edited\n")
        digests.add((arguments[0], printed_by(arguments, tmp_path)))
    assert len(digests) == 6
    assert len({digest for _, digest in digests}) >= 4


def printed_by(arguments: list[str], folder: Path) -> str:
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, check=True, capture_output=True, text=True
    ).stdout


def test_a_module_in_an_archive_has_that_for_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive, digests = tmp_path / "laws.zip", set()
    monkeypatch.syspath_prepend(archive)
    for gain in (1, 2):
        with zipfile.ZipFile(archive, "w") as file:
            file.writestr("packed_law.py", f"class Law: gain = {gain}\n")
        importlib.invalidate_caches()
        digests.add(digest_of("packed_law"))
    assert len(digests | {digest_of("no_such_module")}) == 3
