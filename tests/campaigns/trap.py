"""Everything that another user may have laid out before root comes by, and who touches it.

A trap is a working folder, a home, a temporary folder and a state folder of user 65534. In them lie
modules under the names of what is imported, hooks of Python, pip, bash and numba, compiled kernels,
ledgers, recordings, and links at names that can be foreseen to files of root's. Code in it writes
its name into a file, so that it is seen to have run; and each file of it that is opened is told by
the kernel (inotify), whether it is code or not.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from fasaco_edge.kernels.folder import code_digest
from fasaco_edge.recording.write.quota import next_run

NOBODY = 65534
IN_OPEN, IN_ISDIR, IN_Q_OVERFLOW = 0x20, 0x4000_0000, 0x4000
EVENT = struct.Struct("iIII")
# Of the standard library, of what is installed, and of ours. (Python does not even begin with other
# modules in the place of those that it needs for itself.)
MODULES = (
    "argparse", "json", "logging", "pathlib", "platform", "random", "runpy", "ssl", "struct",
    "sysconfig", "tempfile", "typing", "venv", "zipfile", "fasaco_edge", "llvmlite", "msgspec",
    "numba", "numpy", "PIL", "pip", "pyarrow", "rerun", "rerun_bindings", "rich", "sitecustomize",
    "usercustomize", "wheelhouse", "yaml", "zenoh",
)  # fmt: skip
SECRET = "root's alone\n"
_EPOCH = datetime.fromtimestamp(0, UTC)


class _Payload:
    """Runs when it is unpickled."""

    def __init__(self, code: str) -> None:
        self.code = code

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return exec, (self.code,)


class Trap:
    """A trap in ``place``, which everybody can reach; ``kernels``: a cache to lay one like.

    Attributes:
        work, home, tmp, state: where root is lured to.
        secrets: files of root's that links in the trap point to.
    """

    def __init__(self, place: Path, kernels: Path) -> None:
        self.place, self._kernels = place, kernels
        self.work, self.home, self.tmp, self.state = (
            place / name for name in ("work", "home", "tmp", "state")
        )
        self.mark = place / "LOADED"
        vault = place.with_name(f"{place.name}-vault")
        for folder in (place, self.work, self.home, self.tmp, self.state, vault):
            folder.mkdir()
        self.secrets = [vault / name for name in ("shadow", "torn.rrd", "runs/config.yaml")]
        self._lay()
        for folder, folders, files in os.walk(place):
            for name in (".", *folders, *files):
                os.chown(Path(folder, name), NOBODY, NOBODY, follow_symlinks=False)
            os.chmod(folder, 0o777)

    @property
    def environment(self) -> dict[str, str]:
        """What leads a program into it, but for the working folder."""
        hook = str(self.work / "hook.sh")
        return {
            "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
            "HOME": str(self.home),
            "TMPDIR": str(self.tmp),
            "PYTHONPATH": str(self.work),
            "PYTHONSTARTUP": str(self.work / "json.py"),
            "PYTHONUSERBASE": str(self.home / ".local"),
            "BASH_ENV": hook,
            "ENV": hook,
            "CDPATH": str(self.work),
            "PIP_CONFIG_FILE": str(self.home / ".config/pip/pip.conf"),
            "PIP_TARGET": str(self.work),
            "PIP_FIND_LINKS": str(self.work),
        }

    def _lay(self) -> None:
        folders = [self.work, self.tmp]
        version = f"python{sys.version_info.major}.{sys.version_info.minor}"
        folders.append(self.home / ".local/lib" / version / "site-packages")
        for folder in folders:
            for name in MODULES:
                self._write(folder / f"{name}.py", self._code(name))
                self._write(folder / name / "__init__.py", self._code(name))
            self._write(folder / "trap.pth", f"import os; {self._code('trap.pth')}")
        self._write(self.work / "hook.sh", f"echo hook.sh >>{self.mark}\n")
        self._write(self.work / ".numba_config.yaml", "disable_jit: 1\n")
        self._write(self.work / "config.yaml", "robot: {name: thief}\n")
        self._write(self.work / "pyvenv.cfg", "home = /nonexistent\n")
        for name in (".bashrc", ".profile", ".bash_profile"):
            self._write(self.home / name, f"echo {name} >>{self.mark}\n")
        self._write(self.home / ".config/pip/pip.conf", "[global]\ntarget = /nonexistent\n")
        self._write(self.home / ".pydistutils.cfg", "[install]\nuser = 1\n")
        self._lay_kernels()
        self._lay_links()

    def _lay_kernels(self) -> None:
        """Lay compiled kernels where they are looked for, each a pickle that runs when read."""
        payload = pickle.dumps(_Payload(self._code("kernel")))
        name = f"kernels-{code_digest()}"
        for base in (self.home / ".cache/fasaco-edge" / name, self.tmp / f"fasaco-edge-0-{name}"):
            for file in (path for path in self._kernels.rglob("*") if path.is_file()):
                is_list = file.suffix == ".json"
                content = file.read_bytes() if is_list else payload
                self._write(base / file.relative_to(self._kernels), content)

    def _lay_links(self) -> None:
        """Lay links where files will be written whose names are known beforehand."""
        shadow, torn, config = self.secrets
        for secret in self.secrets:
            self._write(secret, SECRET)
            secret.chmod(0o600)
        # A recording whose end is torn: to be cut, were it in that folder.
        torn.write_bytes(b"RRF2" + bytes(8) + struct.pack("<QQ", 1, 4) + b"good" + b"torn end")
        states = (self.state, self.home / ".local/state/fasaco-edge")
        for folder in states:
            folder.mkdir(parents=True, exist_ok=True)
            for end in ("", ".new", ".previous", ".lock"):
                (folder / f"robot.ledger{end}").symlink_to(shadow)
        (self.state / "old.rrd").symlink_to(torn)
        # Rerun writes to the name it was told.
        for number in range(1, 4):
            (self.state / f"{next_run(self.state, 'robot', _EPOCH)}-part{number}.rrd").symlink_to(
                shadow
            )
        (self.work / "runs").symlink_to(config.parent)

    def _code(self, name: str) -> str:
        return f"open({str(self.mark)!r}, 'a').write({name!r} + '\\n')\n"

    @staticmethod
    def _write(path: Path, content: str | bytes) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)

    def loaded(self) -> list[str]:
        """Return what of the trap's code has run."""
        return self.mark.read_text().splitlines() if self.mark.exists() else []

    def changed_secrets(self, before: list[tuple[object, ...]]) -> list[Path]:
        """Return the files of root's that are not as they were at ``state_of_secrets``."""
        after = self.state_of_secrets()
        return [s for s, b, a in zip(self.secrets, before, after, strict=True) if a != b]

    def state_of_secrets(self) -> list[tuple[object, ...]]:
        """Return what there is to see of root's files, and what lies beside them."""
        return [
            (path.read_bytes(), path.stat().st_mode, path.stat().st_uid, os.listdir(path.parent))
            for path in self.secrets
        ]

    def open_to_all(self, *more: Path) -> list[Path]:
        """Return the files of root's, here and in ``more``, that everybody may write to."""
        found = []
        for place in (self.place, *more):
            for folder, _, files in os.walk(place):
                for path in (Path(folder, name) for name in (".", *files)):
                    status = path.lstat()
                    is_link = path.is_symlink()
                    if status.st_uid == 0 and status.st_mode & 0o002 and not is_link:
                        found.append(path)
        return found

    @contextmanager
    def watched(self) -> Iterator[set[Path]]:
        """Fill a set with the trap's files that are opened meanwhile, whoever opens them."""
        libc = ctypes.CDLL(None, use_errno=True)
        queue = libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
        assert queue >= 0, os.strerror(ctypes.get_errno())
        folders, theirs = {}, set()
        for folder, _, files in os.walk(self.place):
            paths = [Path(folder, name) for name in files]
            theirs.update(path for path in paths if _is_theirs(path))
            number = libc.inotify_add_watch(queue, os.fsencode(folder), IN_OPEN)
            assert number >= 0, os.strerror(ctypes.get_errno())
            folders[number] = Path(folder)
        opened: set[Path] = set()
        try:
            yield opened
            while events := _read(queue):
                at = 0
                while at < len(events):
                    number, mask, _, length = EVENT.unpack_from(events, at)
                    assert not mask & IN_Q_OVERFLOW, "more happened than the kernel could tell"
                    name = events[at + EVENT.size : at + EVENT.size + length].rstrip(b"\0")
                    at += EVENT.size + length
                    if not mask & IN_ISDIR:
                        opened.add(folders[number] / os.fsdecode(name))
            # What a program of ours has written there, it or one beside it may read again.
            opened.intersection_update(theirs)
        finally:
            os.close(queue)


def _is_theirs(path: Path) -> bool:
    """Return whether a file was laid out by the other user."""
    try:
        return path.lstat().st_uid == NOBODY
    except FileNotFoundError:  # a program of ours has taken its own away meanwhile
        return False


def _read(queue: int) -> bytes:
    try:
        return os.read(queue, 1 << 20)
    except BlockingIOError:
        return b""
