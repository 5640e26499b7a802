"""The table of all errors that users meet: each with its code, and a hint on what to do.

A status, an error reply and ``--json`` of the command line carry the code. The text says what is
wrong and where. (``cli.ask`` passes on the errors that a daemon replies with.)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar


class FasacoError(Exception):
    """Base of all errors meant for the users of this package."""

    code = "error"
    hint = ""

    def __init__(self, message: str, *, hint: str | None = None) -> None:
        super().__init__(message)
        self.advise(self.hint if hint is None else hint)

    def advise(self, hint: str) -> None:
        """Set the hint, which tracebacks show, too: a notebook has no command line to print it."""
        self.hint = hint
        self.__notes__ = [f"hint: {hint}"] if hint else []


class DocumentError(FasacoError):
    """A fault of a document: of a configuration, an order, or the file of a map.

    Attributes:
        key: its place, such as ``bus.listen[0]``; "" for the whole document.
        what: what is wrong there, and what is allowed.
        others: further keys that the fault depends on.
        file: the document's file; None if it has none.
        line: line of the key in the file, from 1; None if there is none.
        rest: further faults of the document.
    """

    file: Path | None = None
    line: int | None = None
    rest: tuple[DocumentError, ...] = ()

    def __init__(
        self, what: str, *, hint: str | None = None, key: str = "", others: Sequence[str] = ()
    ) -> None:
        super().__init__(what, hint=hint)
        self.key, self.what, self.others = key, what, tuple(others)

    @property
    def said(self) -> str:
        """Key and fault, without the file."""
        return f"{self.key}: {self.what}" if self.key else self.what

    def __str__(self) -> str:
        """Return file, line, key and fault."""
        line = "" if self.line is None else f", line {self.line}"
        return self.said if self.file is None else f"{self.file}{line}: {self.said}"

    def within(self, key: str, kind: type[_Fault]) -> _Fault:
        """Return the fault of a document that has this one under ``key``, as an error ``kind``.

        A fault that is a ``kind`` keeps its class; another one keeps its hint, unless that is the
        hint of its class.
        """
        made: type[_Fault] = type(self) if isinstance(self, kind) else kind
        hint = None if self.hint == type(self).hint else self.hint
        places = [nested_key(key, each) for each in (self.key, *self.others)]
        return made(self.what, hint=hint, key=places[0], others=places[1:])


_Fault = TypeVar("_Fault", bound=DocumentError)


def nested_key(key: str, below: str) -> str:
    """Return the key of ``below``, a key or an index in brackets, in the object at ``key``."""
    return f"{key}{'.' if key and below and below[0] != '[' else ''}{below}"


def together(faults: Sequence[_Fault]) -> _Fault:
    """Return the first fault of a document, with the others as its ``rest``."""
    first, *rest = faults
    first.rest = tuple(rest)
    return first


class MalformedMessage(FasacoError):
    """A payload is not the message it claims to be."""

    code = "malformed_message"
    hint = "check the publisher's message type and encoding (CDR, little endian)"


class WrongFrame(FasacoError):
    """A pose or map is given in another frame than the mission's."""

    code = "wrong_frame"
    hint = "publish map and pose in the same frame"


class TransformLoop(FasacoError):
    """ROS 2 transforms form a loop, so that none leads to the map."""

    code = "transform_loop"
    hint = "each frame has one parent: look for two programs that publish transforms of one frame"


class MapTooLarge(FasacoError):
    """The map, or the lattice over it, is beyond the configured limit, or its pixels too small."""

    code = "map_too_large"
    hint = (
        "check the map's resolution and origin; map.max_pixels, larger cells or "
        "map.max_lattice_cells may help"
    )


class MapTooFar(FasacoError):
    """The lattice over a map has coordinates that messages cannot hold."""

    code = "map_too_far"
    hint = "check the map's origin; give maps in a frame whose origin is nearer"


class NotPublished(FasacoError):
    """A message could not be encoded or sent; no other message is affected."""

    code = "not_published"
    hint = "the message is skipped, the daemon continues; report it with the log"


class PlanFailed(FasacoError):
    """The planner failed with an internal error."""

    code = "plan_failed"
    hint = "planning is retried with the next map, or after a while; report it with the log"


class PlannerFailed(FasacoError):
    """A planner of the user's own, or its file, raised an exception."""

    code = "planner_failed"
    hint = "the lines are those of your own file, the last one first"


class IllegalWalk(FasacoError):
    """The result of a planner of the user's own is not a walk, or does not solve the problem."""

    code = "illegal_walk"
    hint = "return cells (row, col): from the start, one step each, over all of problem.to_cover"


class MissionBroke(FasacoError):
    """The mission failed with an internal error."""

    code = "mission_broke"
    hint = "it restarts from the ledger; report it with the log"


class MapFileError(DocumentError):
    """A map file is missing or cannot be read as a map."""

    code = "map_file"
    hint = "give a map_server .yaml, a coverage grid .npy, or the name of a built-in map"


class PatchWithoutBase(FasacoError):
    """A map update came before any map, or does not fit the present map."""

    code = "patch_without_base"
    hint = "publish the full map first, latched, and again when asked: updates refer to it"


class StartOutsideMap(FasacoError):
    """The start is not on the lattice at all."""

    code = "start_outside_map"
    hint = "choose a start inside the map"


class StartBlocked(FasacoError):
    """The robot does not fit at the start, or the start is unknown."""

    code = "start_blocked"
    hint = "choose a free start, or check the robot radius"


class EndOutsideMap(FasacoError):
    """The cell to end in is not on the lattice at all."""

    code = "end_outside_map"
    hint = "choose an end inside the map, or none"


class EndBlocked(FasacoError):
    """The robot does not fit at the end, or the end is unknown."""

    code = "end_blocked"
    hint = "choose a free end, or none, or check the robot radius"


class EndUnreachable(FasacoError):
    """No walk leads from the start to the end."""

    code = "end_unreachable"
    hint = "choose an end in the area of the start, or none"


class NothingToCover(FasacoError):
    """No cell is left that is coverable, uncovered and reachable."""

    code = "nothing_to_cover"
    hint = "check cell size and robot radius against the map"


class NotYet(FasacoError):
    """A query came for something that does not exist yet."""

    code = "not_yet"
    hint = "ask again once the daemon has a map and a pose"


class BadQuery(FasacoError):
    """A query has a parameter or a payload that it does not accept."""

    code = "bad_query"
    hint = "remove what the query does not accept; see protocol/commands.md"


class UnknownQuery(FasacoError):
    """There is no query of that name."""

    code = "unknown_query"
    hint = "use one of the names listed"


class BadConfiguration(DocumentError):
    """A configuration key is unknown or its value impossible."""

    code = "bad_configuration"
    hint = "correct the named key or option"


class OpenToEveryone(BadConfiguration):
    """The daemon would accept remote connections without authentication."""

    code = "open_to_everyone"
    hint = (
        "choose bus.security.kind tls or user (protocol/security.md), listen on 127.0.0.1, "
        "or set bus.open_to_everyone: true"
    )


class DiskFailed(FasacoError):
    """A disk is broken or full, or the computer is out of files or memory, perhaps temporarily."""

    code = "disk_failed"
    hint = "check the disk and free space on it; a service retries by itself"


class BusUnavailable(FasacoError):
    """No session could be opened on the Zenoh bus."""

    code = "bus_unavailable"
    hint = "start the daemon or router first, or check the endpoint"


class ClockBeforeCertificate(BusUnavailable):
    """By this computer's clock a certificate is not valid yet."""

    code = "clock_before_certificate"
    hint = "check the clock with `date -u`; timedatectl set-ntp true, or wait for the network"


class MissingExtra(FasacoError):
    """An optional part of the package is not installed."""

    code = "missing_extra"
    hint = "pip install 'fasaco-edge[record]'"


class ProcessEnded(FasacoError):
    """A child process ended unexpectedly."""

    code = "process_ended"


class UnreadableRecording(FasacoError):
    """A file is not a recording, or ends within a frame."""

    code = "unreadable_recording"
    hint = "a recorder started in the same folder cuts a torn recording after its last whole frame"


class DifferentRuns(FasacoError):
    """Files given as the parts of one run are of several runs."""

    code = "different_runs"
    hint = "review the parts of one run at a time, or compare two runs with --against"


class LedgerFileError(FasacoError):
    """A ledger's file is broken, or cannot be read or written."""

    code = "ledger_file"


class RoomsFileError(FasacoError):
    """The file of the rooms is broken, or cannot be read or written."""

    code = "rooms_file"
    hint = (
        "name the rooms again, or put an earlier file in its place while no daemon runs; if it "
        "cannot be written, free the disk"
    )


class LedgerFullError(FasacoError):
    """A ledger is full: what lay farthest from the robot was dropped and is to be covered again."""

    code = "ledger_full"
    hint = "check for poses or maps that jump; in another building start over with `mission reset`"


class LedgerMismatchError(FasacoError):
    """A ledger is of another building, of other cells, or of another release."""

    code = "ledger_mismatch"
    hint = "it was renamed and a new one started; nothing has to be done to continue"


class PlacesElsewhere(FasacoError):
    """Zones, keep-out zones, home or dock of the configuration belong to another map."""

    code = "places_elsewhere"
    hint = (
        "they are not used on this map: go back to their map; or give places of this map, with its "
        "frame as mission.map_frame, and reload; or `mission reset`, after which they count here"
    )


class FleetError(FasacoError):
    """The data of another robot of the fleet do not fit, and are ignored.

    Also raised on a message of another version, which a daemon takes for a robot that does not fit.
    """

    code = "fleet_member"
    hint = (
        "a fleet has at most 33 robots; look for a robot that sends cells far outside the building"
    )


class OrderError(DocumentError):
    """An order that cannot be carried out as it is written."""

    code = "bad_order"
    hint = "correct the named member; see protocol/schema/mission.json"


class CommandError(FasacoError):
    """A command that is not possible in the mission's state."""

    code = "not_now"
    hint = "check the status, and start a mission first"


class WouldForget(FasacoError):
    """A command that would forget what is covered, without the option that allows this."""

    code = "would_forget"
    hint = (
        "give it with --yes (`discard: true`) to forget that; `start` with --keep-covered "
        "(`keep_covered: true`) goes on with the rest, `cancel` drops an order alone"
    )


class NobodyAnswersError(FasacoError):
    """No daemon of that robot is on the bus."""

    code = "nobody_answers"
