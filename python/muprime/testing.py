"""A virtual rig for the tests of other controllers: a pytest plugin, and the class behind it.

    def test_my_controller(virtual_rig):
        rig = virtual_rig(seed=7, defects='[[defect]]\\nname = "lateral_gain"\\nparameters = { factor = 1.1 }\\n')
        my_controller.connect(*rig.modbus_tcp)

Each call starts a ``muprime virtual-rig`` of its own on a free port of loopback; all end with the test. The binary is the one of
``MUPRIME_BINARY``, or ``muprime`` on the path. What its registers are, `muprime doc profile muprime-force2` (unit 1),
`muprime-amplifier` (2) and `muprime-stage` (3) say.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Protocol

import pytest

from ._binary import binary


class VirtualRig:
    """A running virtual rig; it ends with :meth:`close` or at the end of a ``with``."""

    modbus_tcp: tuple[str, int]
    """Host and port of its Modbus TCP server."""

    def __init__(self, seed: int = 1, defects: str | None = None, setup: str = "virtual-ideal") -> None:
        command = [binary(), "--json", "virtual-rig", "--setup", setup, "--modbus-tcp", "127.0.0.1:0", "--seed", str(seed)]
        self._folder = tempfile.TemporaryDirectory(prefix="muprime-")
        if defects is not None:
            path = Path(self._folder.name) / "defects.toml"
            path.write_text(defects, encoding="utf-8")
            command += ["--defects", str(path)]
        # Into a file: nobody reads while the rig serves, and a full pipe would stop it.
        errors = Path(self._folder.name) / "errors.txt"
        with errors.open("wb") as to:
            self._process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=to, text=True)
        assert self._process.stdout is not None
        told = self._process.stdout.readline()
        said = json.loads(told) if told else {}
        if "modbus_tcp" not in said:
            self._process.communicate()
            why = errors.read_text(encoding="utf-8", errors="replace").strip()
            self._folder.cleanup()
            raise ValueError(said.get("error") or why or "the virtual rig did not start")
        host, _, port = said["modbus_tcp"].rpartition(":")
        self.modbus_tcp = (host, int(port))

    def close(self) -> None:
        """Ends it; may be called again."""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(timeout=10)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._folder.cleanup()

    def __enter__(self) -> VirtualRig:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, why: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class StartsRigs(Protocol):
    """Starts a virtual rig with a seed, defects (the text of a defects file) and a bundled setup."""

    def __call__(self, seed: int = 1, defects: str | None = None, setup: str = "virtual-ideal") -> VirtualRig: ...


@pytest.fixture
def virtual_rig() -> Iterator[StartsRigs]:
    """Starts virtual rigs, each on a port of its own; all end with the test."""
    started: list[VirtualRig] = []

    def start(seed: int = 1, defects: str | None = None, setup: str = "virtual-ideal") -> VirtualRig:
        started.append(VirtualRig(seed, defects, setup))
        return started[-1]

    yield start
    for rig in started:
        rig.close()
