#!/bin/bash -p
# Installs fasaco_edge as a service, or upgrades it; `install.sh --help` says how.
set -euo pipefail
PATH=/usr/sbin:/usr/bin:/sbin:/bin:/usr/local/bin

PROGRAM=install.sh
HERE=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")
EXAMPLE=fasaco-edge.yaml
# shellcheck source=deploy/steps/common.sh
. "$HERE/steps/common.sh"
# shellcheck source=deploy/steps/release.sh
. "$HERE/steps/release.sh"
# shellcheck source=deploy/steps/version.sh
. "$HERE/steps/version.sh"
# shellcheck source=deploy/steps/service.sh
. "$HERE/steps/service.sh"

usage() {
    cat <<'TEXT'
usage: install.sh [--wheels DIR] [--without-recording] [--python PYTHON] [--no-start] [--dry-run]
       install.sh --rollback [--dry-run]

Install fasaco_edge as the service fasaco-edge, or upgrade it. Needs bash, systemd, Python 3.11 or
newer, and root.

  --wheels DIR         a folder made by `make wheelhouse`; no network is used. Without it the wheels
                       beside this script, or, in a source tree, those it downloads
  --without-recording  without Rerun, and without the service fasaco-edge-recorder
  --python PYTHON      the Python to run on (default: /usr/bin/python3)
  --no-start           put everything in place, start nothing: for images and containers
  --rollback           back to the version before this one
  --dry-run            print each step, change nothing
  --help               this text

What it does:
  1. builds the version in /opt/fasaco-edge/VERSION, beside the one that runs
  2. checks it: with your configuration, and by compiling its kernels into the service's cache, for
     minutes, unless they are there
  3. points /opt/fasaco-edge/current to it, installs its units, starts it
  4. goes back to the version before if the service does not come up
A mission that is under way goes on from its ledger. /etc/fasaco-edge/config.yaml is written if there
is none, and never again: where the example has changed, the new one lies beside as config.yaml.new.
The version before is kept for --rollback, older ones go. Run twice it changes nothing.

exit codes:
  0 done, or nothing to do      1 failed; what runs goes on running
  2 not understood              3 not possible here: what is missing is said
  4 the new version did not pass its checks; nothing was switched
  5 the new version did not come up; rolled back to the old one
TEXT
}

WHEELS='' RECORDING=yes PYTHON=/usr/bin/python3 START=yes ROLLBACK=''
SCRATCH='' ALONE='' BUILDING='' SWITCHING_FROM='' SWITCHING_TO='' SINCE=0

read_words() {
    while [[ $# -gt 0 ]]; do
        case $1 in
        --wheels | --python)
            [[ ${2:-} ]] || fail $NOT_UNDERSTOOD "$1 needs a value" "see --help"
            if [[ $1 == --wheels ]]; then WHEELS=$2; else PYTHON=$2; fi
            shift
            ;;
        --wheels=*) WHEELS=${1#*=} ;;
        --python=*) PYTHON=${1#*=} ;;
        --without-recording) RECORDING='' ;;
        --no-start) START='' ;;
        --rollback) ROLLBACK=yes ;;
        --dry-run) DRY_RUN=yes ;;
        --help | -h)
            usage
            exit 0
            ;;
        *) fail $NOT_UNDERSTOOD "$1 is not understood" "see --help" ;;
        esac
        shift
    done
    WHEELS=$(from_caller "$WHEELS")
    [[ $PYTHON != */* ]] || PYTHON=$(from_caller "$PYTHON")
}

install_version() {
    require_python
    find_wheels
    read_release
    require_libc
    name_version
    local old
    old=$(version_of current)
    if ! is_complete "$NAME"; then
        require_room
        step "build version $NAME in $PREFIX/$NAME" build_version
        step "check it${START:+, and compile its kernels, for minutes}" try_version
        [[ $DRY_RUN ]] || write_complete
    fi
    lay_settings "$old"
    if [[ $old != "$NAME" ]]; then
        step "switch from ${old:-nothing} to $NAME${START:+, and start it}" switch "$old" "$NAME"
        [[ ! $DRY_RUN ]] || lay_units "$NAME"
    else
        keep_up
    fi
    [[ -L $COMMAND && $(readlink $COMMAND) == "$PREFIX/current/bin/fasaco-edge" ]] ||
        step "link $COMMAND" link_command
    prune
    conclude
}

write_complete() {
    local place=$PREFIX/$NAME
    sync --file-system "$place"
    echo "$VERSION $FINGERPRINT" >"$place/INSTALLED.part"
    name_for_good "$place/INSTALLED.part" "$place/INSTALLED"
    BUILDING=''
}

# The configuration is its owner's; a new example lies beside the old choices.
lay_settings() {
    local example=$HERE/$EXAMPLE
    if [[ ! -e $SETTINGS/config.yaml ]]; then
        lay "$example" "$SETTINGS/config.yaml"
    elif [[ $1 && $1 != "$NAME" ]] && ! cmp --silent "$example" "$PREFIX/$1/deploy/$EXAMPLE" &&
        ! cmp --silent "$example" "$SETTINGS/config.yaml"; then
        lay "$example" "$SETTINGS/config.yaml.new"
    fi
}

link_command() {
    mkdir -p "$(dirname $COMMAND)"
    ln --symbolic --force --no-dereference "$PREFIX/current/bin/fasaco-edge" $COMMAND
}

# The version is there already: see that its service is, too.
keep_up() {
    lay_units "$NAME"
    systemctl --quiet is-enabled $DAEMON || step "enable $DAEMON" systemctl --quiet enable $DAEMON
    if [[ $START ]] && { [[ $CHANGES -gt 0 ]] || ! systemctl --quiet is-active $DAEMON; }; then
        step "start $DAEMON" switch "$NAME" "$NAME"
    fi
}

conclude() {
    if [[ $CHANGES -eq 0 ]]; then
        say "nothing to do: version $NAME is installed"
    elif [[ ! $DRY_RUN ]]; then
        # What is said to be done is on the disk.
        sync --file-system "$PREFIX" "$UNITS" "$SETTINGS"
        say "version $NAME is installed${START:+ and runs}"
    fi
}

return_to_previous() {
    local old new
    old=$(version_of current)
    new=$(version_of previous)
    [[ $new ]] || fail $NOT_POSSIBLE "there is no version before ${old:-this}" \
        "install one from its release folder"
    NAME=$new
    step "switch from $old back to $new" switch "$old" "$new"
    conclude
}

# However this ends: nothing half built stays, and no half made switch.
tidy() {
    local code=$?
    trap '' INT TERM
    if [[ $SWITCHING_TO ]]; then
        say "interrupted while switching"
        (roll_back) || true
    fi
    [[ ! $BUILDING ]] || rm -rf "$BUILDING"
    # An empty one may be that of another install.sh, which has locked it and begins.
    [[ ! $ALONE || ! -d $PREFIX ]] || rmdir --ignore-fail-on-non-empty "$PREFIX" 2>/dev/null || true
    [[ ! $SCRATCH ]] || rm -rf "$SCRATCH"
    exit "$code"
}

main() {
    read_words "$@"
    require_root
    require_systemd
    # A robot may be driving: what is done here gives way to it.
    renice --priority 10 $$ >/dev/null 2>&1 || true
    SCRATCH=$(mktemp --directory /tmp/fasaco-edge.XXXXXXXXXX)
    trap tidy EXIT
    trap 'exit 130' INT
    trap 'exit 143' TERM
    [[ $DRY_RUN ]] || mkdir -p "$PREFIX"
    require_to_be_alone
    [[ $DRY_RUN ]] || ALONE=yes
    if [[ $ROLLBACK ]]; then return_to_previous; else install_version; fi
}

main "$@"
