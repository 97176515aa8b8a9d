"""The pages of the documentation site: those that are written, and the reference, made from the code.

    python docs/site/make_site.py [FOLDER]

Writes them into FOLDER, ``build/docs`` unless another one is named; ``make docs`` builds the site of them.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from code_reference import ROOT, pages
from command_reference import commands_page
from message_reference import messages_page, outcomes_page, tables_text
from scene_keys import keys_page

DOCS = ROOT / "docs"
COPIED = {".md", ".png", ".css", ".json"}


def reference() -> dict[str, str]:
    """Return the generated pages by their paths below the folder of the site.

    Where a page of this path is written, its text is the end of it.
    """
    return {
        "reference/scene_keys.md": keys_page(),
        "reference/messages.md": messages_page(),
        "reference/outcomes.md": outcomes_page(),
        "reference/csv.md": tables_text(),
        "reference/command_line.md": commands_page(),
        **{f"reference/code/{name}": text for name, text in pages().items()},
    }


def write_site(folder: Path) -> None:
    """Write all pages and pictures into a folder, which is emptied before."""
    shutil.rmtree(folder, ignore_errors=True)
    for path in sorted(path for path in DOCS.rglob("*") if path.suffix in COPIED):
        target = folder / path.relative_to(DOCS)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    for name, text in reference().items():
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        head = target.read_text(encoding="utf-8") if target.exists() else ""
        target.write_text(head + text, encoding="utf-8")


if __name__ == "__main__":
    write_site(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "docs")
