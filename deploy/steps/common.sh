# What install.sh and uninstall.sh share: where things lie, how they speak, how they end.
# shellcheck shell=bash disable=SC2034  # what is set here is used by those who read this file

PREFIX=/opt/fasaco-edge
COMMAND=/usr/local/bin/fasaco-edge
SETTINGS=/etc/fasaco-edge
UNITS=/etc/systemd/system
KERNELS=/var/cache/fasaco-edge/numba
DAEMON=fasaco-edge.service
RECORDER=fasaco-edge-recorder.service
# Whoever needs it installs it.
FOLLOWER=fasaco-edge-follow.service

# What a caller's environment, folder and mode mask say does not count here: root runs this, and
# anybody may have written what they point to. (Run by its own first line, bash takes neither
# functions nor BASH_ENV from there.)
CALLED_FROM=$PWD
for name in $(compgen -e); do
    [[ $name == SETTLE_S ]] || unset "$name" 2>/dev/null || true
done
unset name
PATH=/usr/sbin:/usr/bin:/sbin:/bin:/usr/local/bin
export PATH LC_ALL=C.UTF-8
umask 022
cd /
# How long a service has to stay up to count as up [s].
SETTLE_S=${SETTLE_S:-3}

# Exit codes; --help explains them.
FAILED=1 NOT_UNDERSTOOD=2 NOT_POSSIBLE=3 NOT_FIT=4 ROLLED_BACK=5

DRY_RUN=
CHANGES=0

say() {
    printf '%s\n' "$*"
}

# fail EXIT_CODE MESSAGE HINT: end, with what was wrong and what to do.
fail() {
    printf '%s: %s\n' "$PROGRAM" "$2" >&2
    printf '  hint: %s\n' "$3" >&2
    exit "$1"
}

# step WHAT COMMAND...: say what is done and do it; a dry run only says it.
step() {
    CHANGES=$((CHANGES + 1))
    if [[ $DRY_RUN ]]; then
        say "would $1"
    else
        say "$1"
        "${@:2}"
    fi
}

require_root() {
    if [[ $EUID -ne 0 && ! $DRY_RUN ]]; then
        fail $NOT_POSSIBLE "this changes the system, which only root may" \
            "run it with sudo; --dry-run shows as any user what it would do"
    fi
}

# Nothing is laid down for this: the folder itself is what is locked.
require_to_be_alone() {
    [[ -d $PREFIX && ! $DRY_RUN ]] || return 0
    exec 9<"$PREFIX"
    flock --nonblock 9 || fail $NOT_POSSIBLE "another install.sh or uninstall.sh is at work" \
        "wait until it is done"
}

# from_caller PATH: the same, absolute, if it is relative to where this was called.
from_caller() {
    if [[ ! $1 || $1 == /* ]]; then echo "$1"; else echo "$CALLED_FROM/$1"; fi
}

systemd_runs() {
    [[ -d /run/systemd/system ]]
}

# version_of LINK: the folder that $PREFIX/current or $PREFIX/previous points to, if any.
version_of() {
    if [[ -L $PREFIX/$1 && -d $PREFIX/$1/ ]]; then
        readlink "$PREFIX/$1"
    fi
}

# name_for_good FILE PLACE: let PLACE be that file, whole: also after a loss of power.
name_for_good() {
    sync "$1" && mv --force --no-target-directory "$1" "$2" && sync "$(dirname "$2")"
}
