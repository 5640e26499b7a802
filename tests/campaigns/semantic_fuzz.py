"""Legal messages in senseless order, a million of them: none ends or delays the daemon.

    python -m tests.campaigns.semantic_fuzz --events 1000000
    python -m tests.campaigns.semantic_fuzz --in-process --events 1000000
    python -m tests.campaigns.semantic_fuzz --replay FILE

Takes an hour.

The first talks to real daemons behind a real router, the second to a mission in this process, which
comes by many more states a second. The seed decides what is said; what is found is told with it,
and its last events are written to a file that --replay says again.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import traceback
from collections import Counter, deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fasaco_edge.bench.processes import warm_kernels
from tests.campaigns.senseless import SILENT, Event, Senseless
from tests.campaigns.senseless_daemon import LATE_SHARE, Campaign
from tests.campaigns.senseless_mission import MissionTrial
from tests.campaigns.services import show

# What is written down of the events before a finding.
RING = 30_000
# After so many findings there is enough to mend.
MOST_FINDINGS = 5
# Number of events of a mission within this process; largest size of its maps [pixels].
MISSION_EVENTS, MISSION_PIXELS = 10_000, 90_000
SHOW_EVERY = 10_000


class Findings:
    """What was found, each with the events before it in a file.

    Attributes:
        texts: of all that was found.
    """

    def __init__(self, folder: Path) -> None:
        self.texts: list[str] = []
        self.recent: deque[Event] = deque(maxlen=RING)
        self._folder = folder

    def note(self, error: BaseException, seed: int, event: Event) -> None:
        """Write down what was found, and how it came to it."""
        text = "".join(traceback.format_exception(error, limit=-6))
        file = self._folder / f"semantic_fuzz-{seed}-{len(self.texts)}.json"
        document = {"seed": seed, "found": text, "events": [*self.recent, event]}
        self._folder.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(document))
        last = "\n".join(f"  {json.dumps(each)[:300]}" for each in [*self.recent, event][-5:])
        self.texts.append(f"seed {seed}: {text}\nthe last events, more in {file}:\n{last}")
        print(self.texts[-1], file=sys.stderr, flush=True)

    @property
    def are_enough(self) -> bool:
        """Whether to stop looking."""
        return len(self.texts) >= MOST_FINDINGS


def counted(events: Iterable[Event], most: int) -> Iterable[Event]:
    """Yield events until so many of them were messages."""
    for event in events:
        if most <= 0:
            return
        yield event
        most -= event["do"] not in SILENT


def fuzz_daemon(
    folder: Path, events: Iterable[Event], most: int, seed: int, findings: Findings, pace_hz: float
) -> dict[str, Any]:
    """Say events to daemons; return figures."""
    done = 0
    with Campaign(folder, pace_hz) as campaign:
        for event in counted(events, most):
            try:
                findings.recent.append(campaign.perform(event))
            except Exception as error:
                findings.note(error, seed, event)
                if findings.are_enough:
                    break
                campaign.revive()
            done += event["do"] not in SILENT
            if done % SHOW_EVERY == 0:
                show(f"{done:,} of {most:,} events {campaign.judge.status.get('loop_ms')}")
        try:
            campaign.end()
        except Exception as error:
            findings.note(error, seed, {"do": "end"})
        turns = campaign.loop["turns"]
        recovered = sorted(campaign.recovered_s) or [0.0]
        return {
            "events": done,
            **dict(sorted(campaign.counts.items())),
            **dict(sorted(campaign.judge.counts.items())),
            "honest again after [s], median": round(recovered[len(recovered) // 2], 2),
            "honest again after [s], most": round(recovered[-1], 2),
            **{name: round(value) for name, value in campaign.memory.items()},
            **{f"loop: {name}": round(value, 3) for name, value in campaign.loop.items()},
            "loop: late share": round(campaign.loop["late"] / max(turns, 1), 6),
            "longest turns [ms]": campaign.stalls,
        }


def fuzz_missions(most: int, seed: int, findings: Findings) -> dict[str, Any]:
    """Say events to missions within this process; return figures."""
    done, counts = 0, Counter[str]()
    slowest: list[tuple[float, str]] = []
    for number in range(-(-most // MISSION_EVENTS)):
        stream = Senseless(seed + number, MISSION_PIXELS, check_every=1_000, restart_every=1_500)
        trial = MissionTrial(seed + number)
        findings.recent.clear()
        event: Event = {}
        try:
            for event in counted(stream, min(MISSION_EVENTS, most - done)):
                trial.perform(event)
                findings.recent.append(event)
                done += event["do"] not in SILENT
            trial.close()
            show(f"{done:,} of {most:,} events")
        except Exception as error:
            findings.note(error, seed + number, event)
            if findings.are_enough:
                break
        # A mission that fails early has not been looked at yet.
        largest = trial.counts.pop("largest ledger [tiles]", 0)
        largest = max(counts["largest ledger [tiles]"], largest)
        counts += trial.counts
        counts["largest ledger [tiles]"] = largest
        slowest = sorted([*slowest, *trial.slowest_s], reverse=True)[:5]
    longest = [(round(1e3 * seconds, 1), about) for seconds, about in slowest]
    return {"events": done, **dict(sorted(counts.items())), "longest turns [ms]": longest}


def replay_mission(events: list[Event], seed: int, findings: Findings) -> dict[str, Any]:
    """Say recorded events to one mission within this process."""
    trial = MissionTrial(seed)
    for event in events:
        try:
            trial.perform(event)
        except Exception as error:
            findings.note(error, seed, event)
            break
    return dict(trial.counts)


def table(figures: dict[str, Any]) -> str:
    """Return figures as lines."""
    lines = []
    for name, value in figures.items():
        values = value if isinstance(value, list) else [value]
        lines += [f"{name:34} {each}" for each in values]
    return "\n".join(lines)


def main() -> None:
    """Run the campaign; exit with 1 where anything was found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--events", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--in-process", action="store_true", help="a mission, no daemon")
    parser.add_argument("--replay", type=Path, metavar="FILE", help="say the events in a file")
    parser.add_argument("--pace", type=float, default=2_000.0, help="most events a second")
    parser.add_argument("--most-pixels", type=int, default=1_000_000, help="of one map")
    parser.add_argument("--out", type=Path, default=Path.cwd(), help="where findings are written")
    args = parser.parse_args()
    findings, started = Findings(args.out), time.monotonic()
    warm_kernels()
    events: Iterable[Event] = Senseless(args.seed, args.most_pixels)
    if args.replay:
        document = json.loads(args.replay.read_text())
        args.seed, events = document["seed"], document["events"]
    if args.in_process:
        figures = (
            replay_mission(list(events), args.seed, findings)
            if args.replay
            else fuzz_missions(args.events, args.seed, findings)
        )
    else:
        with tempfile.TemporaryDirectory() as folder:
            figures = fuzz_daemon(Path(folder), events, args.events, args.seed, findings, args.pace)
        if figures["loop: late share"] > LATE_SHARE:
            findings.texts.append(f"{figures['loop: late share']:.2%} of turns took over 100 ms")
    figures |= {"seconds": round(time.monotonic() - started), "found": findings.texts}
    print(table(figures))
    sys.exit(bool(findings.texts))


if __name__ == "__main__":
    main()
