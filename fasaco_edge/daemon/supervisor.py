"""The recorder's supervisor: runs the recorder so that its faults affect only the recording."""

from __future__ import annotations

import logging
import os
import subprocess
import time
from pathlib import Path

import msgspec
from msgspec.structs import asdict

from fasaco_edge.bus.arrival import Sample
from fasaco_edge.bus.mailbox import LatestSlot
from fasaco_edge.bus.session import Bus
from fasaco_edge.config.config import DaemonConfig
from fasaco_edge.errors import MalformedMessage
from fasaco_edge.host.processes import cpu_seconds, python_program
from fasaco_edge.wire import topics
from fasaco_edge.wire.documents.json_text import decode_tolerant
from fasaco_edge.wire.documents.status import Recorder, SupervisedRecorder

LOG = logging.getLogger(__name__)

# Pause before a restart [s], doubled with each restart.
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 30.0
# Time without a report after which a running recorder counts as hung, even on a slow computer [s].
SILENT_AFTER_S = 30.0
# Timeout of its first report, as slow computers load its libraries for half a minute [s].
START_WITHIN_S = 120.0
# A recorder that is ending counts as hung if it used less processor time than this during a wait
# for its end [s].
WORKS_S = 0.01


class RecorderSupervisor:
    """Starts ``fasaco-edge record``, and starts it again when it dies or hangs.

    A recorder whose configuration is wrong (``EX_CONFIG``) is not started again.
    """

    def __init__(self, config: DaemonConfig, bus: Bus, folder: Path) -> None:
        self._config = msgspec.json.encode(config)
        parent = ["--with-parent", str(os.getpid())]
        program = python_program("fasaco_edge", "record")
        self._command = [*program, *parent, "--config", "-", "--out", str(folder)]
        self._reports = LatestSlot[Sample]()
        self._report: Recorder | None = None
        self._began_at = self._reported_at = time.monotonic()
        self._restarts = 0
        self._pause_s = FIRST_PAUSE_S
        self._start_at: float | None = None
        self._death = ""
        bus.listen(config.keys(), topics.RECORDER, self._reports.put)
        self._process: subprocess.Popen[bytes] | None = None
        self._launch()

    def poll(self, now: float) -> SupervisedRecorder:
        """Restart the process if needed; return its state for the daemon's status."""
        self._take_report(now)
        code = self._process.poll() if self._process is not None else None
        if self._process is not None and code is None:
            return self._running(now)
        if code == os.EX_CONFIG:
            return self._failed()
        if self._start_at is None:
            if code is not None:
                self._death = f"died by signal {-code}" if code < 0 else f"exited with {code}"
            LOG.warning("recorder %s; it restarts in %.0f s", self._death, self._pause_s)
            self._start_at = now + self._pause_s
            self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)
        elif now >= self._start_at:
            self._start_at = None
            self._restarts += 1
            self._report, self._began_at, self._reported_at = None, now, now
            self._launch()
        return SupervisedRecorder("restarting", self._restarts, self._death)

    def _failed(self) -> SupervisedRecorder:
        """Return the state of a recorder whose folder or configuration is wrong."""
        reason = "its folder or configuration is wrong, see the log"
        if self._death != reason:
            self._death = reason
            LOG.error("recorder exited with %d: it is not started again", os.EX_CONFIG)
        return SupervisedRecorder("failed", self._restarts, reason)

    def _launch(self) -> None:
        """Start the process; this may fail without memory or process ids."""
        try:
            # A file in memory, as a pipe would need concurrent writing and reading.
            with open(os.memfd_create("configuration"), "w+b") as document:
                document.write(self._config)
                document.seek(0)
                # A process group of its own keeps Ctrl-C away: the recorder ends after the daemon's
                # last messages.
                self._process = subprocess.Popen(self._command, stdin=document, process_group=0)
        except OSError as error:
            self._process, self._death = None, f"could not be started: {error.strerror}"

    def close(self, timeout_s: float, longest_s: float) -> None:
        """End the recorder; kill it if its footer is not written in ``timeout_s`` [s].

        A recorder that still works, on a slow or busy computer, gets up to ``longest_s`` [s].
        """
        if self._process is None or self._process.poll() is not None:
            return
        asked, pid = time.monotonic(), self._process.pid
        worked_s = cpu_seconds(pid)
        self._process.terminate()
        while True:
            try:
                self._process.wait(timeout_s)
                return
            except subprocess.TimeoutExpired:
                before, worked_s = worked_s, cpu_seconds(pid)
            waited_s = time.monotonic() - asked
            if worked_s - before < WORKS_S or waited_s + timeout_s > longest_s:
                break
        LOG.warning("recorder did not end in %.1f s: killed", waited_s)
        self._process.kill()
        self._process.wait()

    def _take_report(self, now: float) -> None:
        sample = self._reports.take(timeout_s=0.0)
        if sample is None:
            return
        try:
            report = decode_tolerant(sample.payload, Recorder)
        except MalformedMessage:
            return
        if self._process is not None and report.pid == self._process.pid:
            self._report, self._reported_at = report, now
            # A report alone does not reset the pause: a recorder may report, then fail on its data.
            if now - self._began_at >= LONGEST_PAUSE_S:
                self._pause_s = FIRST_PAUSE_S

    def _running(self, now: float) -> SupervisedRecorder:
        patience_s = SILENT_AFTER_S if self._report else START_WITHIN_S
        if now - self._reported_at > patience_s:
            # The next poll handles it as a recorder that died.
            assert self._process is not None
            self._process.kill()
            reason = f"no status for {patience_s:.0f} s"
            return SupervisedRecorder("silent", self._restarts, reason)
        if self._report is None:
            return SupervisedRecorder("starting", self._restarts)
        return SupervisedRecorder(restarts=self._restarts, **asdict(self._report))
