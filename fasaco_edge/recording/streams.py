"""What rerun's streams leave behind in a process that outlives many of them (rerun 0.41).

A stream that nobody holds any more keeps two threads and half a megabyte until it is swept up.
Of each blueprint that is sent another stream stays that holds itself: for ever, if nobody
disconnects it.
"""

from __future__ import annotations

import rerun_bindings as bindings

from fasaco_edge.recording import entities
from fasaco_edge.recording.sdk import rr, rrb


def send_blueprint(stream: rr.RecordingStream, blueprint: rrb.Blueprint) -> None:
    """Send a blueprint as ``rr.send_blueprint`` does, and let go of what it was written with."""
    native = bindings.new_blueprint(
        application_id=entities.APPLICATION,
        make_default=False,
        make_thread_default=False,
        default_enabled=True,
    )
    written = rr.RecordingStream._from_native(native)
    written.set_time("blueprint", sequence=0)
    blueprint._log_to_stream(written)
    storage = written.memory_recording().storage
    bindings.send_blueprint(storage, True, True, recording=stream.to_native())
    written.disconnect()


def sweep() -> None:
    """Free what nobody holds any more; flushes all there are, so none may hang."""
    bindings.flush_and_cleanup_orphaned_recordings()
