"""A sweep as a device of bluesky: ``pip install "muprime[bluesky]"``.

    from bluesky import RunEngine
    from muprime.bluesky import Sweep, fly_sweep

    engine = RunEngine()
    sweep = Sweep("first-sweep", out="runs/today", setup="rig.toml", name="sweep")
    engine(fly_sweep(sweep), print)

The sweep is made by ``muprime run``, a process of its own, with its real-time loop and its safety core: Python never commands a rig. bluesky hears one event a
pass while it goes on, with units; an abort of the engine stops the run as Ctrl-C does, which brings the rig to rest. The binary is the one of
``MUPRIME_BINARY``, or ``muprime`` on the path.
"""

from __future__ import annotations

import asyncio
import json
import os
import signal
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, cast

import bluesky.plan_stubs as bps
import bluesky.preprocessors as bpp
from bluesky.protocols import Reading
from bluesky.utils import MsgGenerator
from event_model import DataKey, PartialEvent
from ophyd_async.core import AsyncStatus, Device

from ._binary import binary

COLUMNS: dict[str, tuple[str, str, str]] = {
    "point": ("integer", "", "number of the pass in the plan"),
    "time_s": ("number", "s", "start of the pass, from the start of the run"),
    "amplitude_pp_m": ("number", "m", "peak-to-peak amplitude of the plate"),
    "frequency_hz": ("number", "Hz", "frequency of the vibration"),
    "speed_m_s": ("number", "m/s", "sliding speed"),
    "direction": ("integer", "", "1 or -1"),
    "position_m": ("number", "m", "mean position"),
    "normal_force_n": ("number", "N", "mean normal force, positive in compression"),
    "lateral_force_n": ("number", "N", "mean lateral force, signed in the sensor's frame"),
    "mu_relative": ("number", "", "measured relative friction; NaN before there is a reference"),
    "mu_relative_sd": ("number", "", "its standard uncertainty"),
    "mu_relative_predicted": ("number", "", "what the model says"),
}
"""Of each column: type, unit, meaning."""


class SweepError(RuntimeError):
    """The run was refused, tripped, or could not be kept: with the cause and the remedy that ``muprime run`` gives."""


class Sweep(Device):
    """A friction sweep, flyable: ``kickoff`` starts ``muprime run``, ``complete`` waits for its end, ``collect`` yields the passes so far.

    ``plan`` and ``setup`` are files or bundled names. ``fast`` runs a virtual rig in virtual time. An unfinished run in ``out`` is taken up again.
    """

    def __init__(
        self,
        plan: str | os.PathLike[str] = "first-sweep",
        *,
        out: str | os.PathLike[str],
        setup: str | os.PathLike[str] = "virtual-ideal",
        seed: int | None = None,
        fast: bool = False,
        name: str = "sweep",
    ) -> None:
        self.out = Path(out)
        self.words = ["--json", "run", os.fspath(plan), "--setup", os.fspath(setup), "--out", os.fspath(out)]
        self.words += [f"--seed={seed}"] if seed is not None else []
        self.words += ["--fast"] if fast else []
        self.plan, self.setup = os.fspath(plan), os.fspath(setup)
        self.summary: dict[str, Any] | None = None
        """How the run ended; none before."""
        self._process: asyncio.subprocess.Process | None = None
        self._listening: asyncio.Task[None] | None = None
        self._passes: list[PartialEvent] = []
        self._stopped = False
        self._error: dict[str, Any] | None = None
        super().__init__(name=name)

    async def describe_collect(self) -> dict[str, DataKey]:
        """The columns of an event, with units."""
        return {
            f"{self.name}-{column}": DataKey(
                source=f"muprime run {self.plan} on {self.setup}", dtype=dtype, shape=[], units=unit  # type: ignore[typeddict-item]
            )
            for column, (dtype, unit, _) in COLUMNS.items()
        }

    @AsyncStatus.wrap
    async def kickoff(self) -> None:
        """Starts the run; done at its first word. What it refuses fails here, with nothing touched."""
        if self._process is not None and self._process.returncode is None:
            raise SweepError("the sweep is still going on")
        command = binary()
        self.summary, self._error, self._passes, self._stopped = None, None, [], False
        # A session of its own: Ctrl-C goes to the engine, which says what becomes of the run.
        self._process = await asyncio.create_subprocess_exec(
            command,
            *self.words,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=1 << 24,
            start_new_session=True,
        )
        began: asyncio.Event = asyncio.Event()
        self._listening = asyncio.create_task(self._listen(self._process, began))
        await began.wait()
        if self._error is not None:
            await self._listening
            raise self._failure()

    async def _listen(self, process: asyncio.subprocess.Process, began: asyncio.Event) -> None:
        assert process.stdout is not None
        try:
            async for line in process.stdout:
                told = json.loads(line)
                if "pass" in told:
                    self._passes.append(self._event(told["pass"]))
                elif "summary" in told:
                    self.summary = told["summary"]
                elif "error" in told:
                    self._error = told
                began.set()
            await process.wait()
        finally:
            began.set()

    def _event(self, told: dict[str, Any]) -> PartialEvent:
        one, comparison = told["pass"], told["comparison"]
        values = {
            **one,
            "amplitude_pp_m": one["amplitude"],
            "mu_relative": comparison["mu_relative"],
            "mu_relative_sd": comparison["mu_relative_sd"],
            "mu_relative_predicted": comparison["predicted"],
        }
        now = time.time()
        # JSON has no NaN: what is not known yet comes as null.
        data = {f"{self.name}-{c}": float("nan") if values[c] is None else values[c] for c in COLUMNS}
        return PartialEvent(data=data, time=now, timestamps=dict.fromkeys(data, now))

    @AsyncStatus.wrap
    async def complete(self) -> None:
        """Waits for the end. A run that did not complete fails here, with its cause and remedy; its passes are in the stream all the same."""
        if self._listening is None:
            raise SweepError("the sweep was not kicked off")
        await asyncio.shield(self._listening)
        # What the engine itself stopped is no failure of the sweep: the engine says that it was aborted.
        if self._stopped and self.summary is not None and self.summary["outcome"] == "stopped":
            return
        if self._error is not None or self.summary is None or self.summary["outcome"] != "complete":
            raise self._failure()

    def _failure(self) -> SweepError:
        told = self._error or self.summary or {}
        words = [told.get("error"), *told.get("causes", []), told.get("outcome"), told.get("cause")]
        words += [told.get("help"), told.get("remedy")]
        said = ": ".join(str(word) for word in words if word)
        return SweepError(said or "muprime run ended without a word")

    async def collect(self) -> AsyncIterator[PartialEvent]:
        """The passes since the last call."""
        passes, self._passes = self._passes, []
        for one in passes:
            yield one

    async def stop_run(self) -> None:
        """Stops a run that goes on, as Ctrl-C does, and waits until the rig is at rest and the record is whole."""
        process, listening = self._process, self._listening
        if process is not None and process.returncode is None:
            self._stopped = True
            process.send_signal(signal.SIGINT)
        if listening is not None:
            await asyncio.shield(listening)

    async def stop(self, success: bool = True) -> None:
        """Called by the engine where a plan ends early."""
        await self.stop_run()

    async def read_configuration(self) -> dict[str, Reading[str]]:
        """Plan, setup and folder."""
        now = time.time()
        told = {"plan": self.plan, "setup": self.setup, "folder": os.fspath(self.out)}
        return {f"{self.name}-{key}": Reading(value=value, timestamp=now) for key, value in told.items()}

    async def describe_configuration(self) -> dict[str, DataKey]:
        """Of the same."""
        return {
            f"{self.name}-{key}": DataKey(source=self.name, dtype="string", shape=[])
            for key in ("plan", "setup", "folder")
        }


def fly_sweep(sweep: Sweep, md: dict[str, Any] | None = None, flush_period_s: float = 0.5) -> MsgGenerator[Any]:
    """A plan of bluesky: the sweep from beginning to end, with an event a pass in the stream ``passes`` while it goes on."""

    def inner() -> MsgGenerator[Any]:
        yield from bps.declare_stream(cast(Any, sweep), name="passes", collect=True)
        # A sweep cannot be taken up in its middle: an engine that is asked to pause ends the plan, and the run with it.
        yield from bps.clear_checkpoint()
        yield from bps.kickoff(sweep, wait=True)
        try:
            yield from bps.collect_while_completing([sweep], [sweep], flush_period=flush_period_s, stream_name="passes")
        finally:
            yield from bps.wait_for([sweep.stop_run])

    about = {"plan_name": "fly_sweep", "muprime_folder": os.fspath(sweep.out), **(md or {})}
    return (yield from cast(Any, bpp.run_wrapper)(inner(), md=about))
