"""Where the ``muprime`` command is."""

import os
import shutil


def binary() -> str:
    """The command: of ``MUPRIME_BINARY``, or on the path."""
    found = os.environ.get("MUPRIME_BINARY") or shutil.which("muprime")
    if found is None:
        raise FileNotFoundError("no muprime on the path: install it, or name it in MUPRIME_BINARY")
    return found
