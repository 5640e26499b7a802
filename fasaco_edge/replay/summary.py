"""Whether a replay was of the very mission that was recorded, and where it was not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fasaco_edge import __version__
from fasaco_edge.replay.turn_replay import Difference, TurnReplay

if TYPE_CHECKING:
    from fasaco_edge.replay.replay import Replay
    from fasaco_edge.replay.turn_record import TurnRecord

# Of samples that are not as they were taken, so many are named.
NAMED = 5


def turn_summary(replay: Replay | TurnReplay, record: TurnRecord | None) -> dict[str, Any]:
    """Return what a replay by turns came to; ``equal`` is None of an approximate one."""
    if record is None or not isinstance(replay, TurnReplay):
        return {"equal": None}
    then, difference = record.beginning, replay.difference
    return {
        "equal": difference is None and not replay.lacking and not record.gap,
        "turns": record.turns,
        "turns_equal": replay.turns,
        "plans_repeated": replay.plans,
        "difference": None if difference is None else _document(difference),
        "samples_lacking": [_document(lacking) for lacking in replay.lacking],
        "log_ends": record.gap,
        "version": {"recorded": then.version, "replayed": __version__},
        "kernels": {"recorded": record.kernels, "replayed": replay.kernels},
    }


def turn_rows(summary: dict[str, Any]) -> list[tuple[str, object]]:
    """Return the summary of a replay by turns for people."""
    if summary["equal"] is None:
        return [("replay", "approximate: there is no turn log from the beginning, or it is unused")]
    turns = f"{summary['turns_equal']} of {summary['turns']} turns"
    said = "equal bit for bit" if summary["equal"] else "equal as far as can be compared"
    if summary["difference"] is not None:
        said = "not equal"
    rows: list[tuple[str, object]] = [("replay", f"{said}: {turns}")]
    if summary["difference"] is not None:
        rows.append(("first difference", _words(summary["difference"])))
    lacking = summary["samples_lacking"]
    rows.extend(("sample", _words(document)) for document in lacking[:NAMED])
    if len(lacking) > NAMED:
        rows.append(("samples", f"{len(lacking) - NAMED} more are not as they were taken"))
    if summary["log_ends"]:
        rows.append(("compared up to", f"turn {summary['turns']}: {summary['log_ends']}"))
    for name in ("version", "kernels"):
        was, now = summary[name]["recorded"], summary[name]["replayed"]
        if was and was != now:
            rows.append((name, f"recorded with {was}, replayed with {now}"))
    return rows


def _document(difference: Difference) -> dict[str, Any]:
    return {
        "turn": difference.turn,
        "at_s": round(difference.at_s, 6),
        "what": difference.what,
        "recorded": difference.recorded,
        "replayed": difference.replayed,
    }


def _words(document: dict[str, Any]) -> str:
    return (
        f"turn {document['turn']} at {document['at_s']:.2f} s: {document['what']} "
        f"was {document['recorded']}, is {document['replayed']}"
    )
