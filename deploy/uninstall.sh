#!/bin/bash -p
# Removes what install.sh has installed; `uninstall.sh --help` says how.
set -euo pipefail
PATH=/usr/sbin:/usr/bin:/sbin:/bin:/usr/local/bin

PROGRAM=uninstall.sh
HERE=$(dirname "$(readlink -f "${BASH_SOURCE[0]}")")
# shellcheck source=deploy/steps/common.sh
. "$HERE/steps/common.sh"

# Of the service's folders: caches go always, what it has written only with --purge.
STATE=(/var/lib /var/log)
CACHE=(/var/cache)
PURGE=''

usage() {
    cat <<'TEXT'
usage: uninstall.sh [--purge] [--dry-run]

Stop fasaco_edge and remove it: the services, /opt/fasaco-edge with all versions, compiled kernels.

  --purge    its state and recordings, its configuration and its drop-ins as well
  --dry-run  print each step, change nothing
  --help     this text

Without --purge these stay, and a later install goes on with them:
  /var/lib/fasaco-edge   ledgers of missions and recordings
  /etc/fasaco-edge       the configuration; removed if nobody has changed it
  /etc/systemd/system/fasaco-edge*.service.d   drop-ins

exit codes: 0 done, or nothing was installed; 1 failed; 2 not understood; 3 not possible here
TEXT
}

read_words() {
    local word
    for word in "$@"; do
        case $word in
        --purge) PURGE=yes ;;
        --dry-run) DRY_RUN=yes ;;
        --help | -h)
            usage
            exit 0
            ;;
        *) fail $NOT_UNDERSTOOD "$word is not understood" "see --help" ;;
        esac
    done
}

remove_services() {
    local unit found=
    for unit in $FOLLOWER $RECORDER $DAEMON; do
        [[ -e $UNITS/$unit ]] || continue
        found=yes
        step "stop and remove $unit" remove_service "$unit"
    done
    [[ ! $found || $DRY_RUN ]] || ! systemd_runs || systemctl daemon-reload
}

# shellcheck disable=SC2317  # `step` calls it
remove_service() {
    if systemd_runs; then
        systemctl --quiet disable --now "$1"
        systemctl reset-failed "$1" 2>/dev/null || true
    else
        systemctl --quiet disable "$1"
    fi
    rm -f "$UNITS/$1"
}

# What is the example of the version that runs, nobody has changed.
remove_untouched_settings() {
    local example=$PREFIX/current/deploy/fasaco-edge.yaml
    if [[ -f $SETTINGS/config.yaml.new ]]; then
        step "remove $SETTINGS/config.yaml.new" rm "$SETTINGS/config.yaml.new"
    fi
    if [[ -f $SETTINGS/config.yaml ]] && cmp --silent "$example" "$SETTINGS/config.yaml"; then
        step "remove $SETTINGS/config.yaml, which is the example" rm "$SETTINGS/config.yaml"
        [[ $DRY_RUN ]] || rmdir --ignore-fail-on-non-empty "$SETTINGS"
    fi
}

# remove PATH...: what there is of it.
remove() {
    local path
    for path in "$@"; do
        [[ ! -e $path && ! -L $path ]] || step "remove $path" rm -rf "$path"
    done
}

# remove_folders PARENT...: the service's folders in there; systemd keeps a dynamic user's in private.
remove_folders() {
    local parent
    for parent in "$@"; do
        remove "$parent"/fasaco-edge "$parent"/fasaco-edge-* "$parent"/private/fasaco-edge \
            "$parent"/private/fasaco-edge-*
    done
}

tell_what_stays() {
    local path stays=()
    for path in "$SETTINGS" /var/lib/private/fasaco-edge* /var/log/private/fasaco-edge* \
        "$UNITS"/fasaco-edge*.service.d; do
        [[ ! -e $path ]] || stays+=("$path")
    done
    [[ ${#stays[@]} -eq 0 ]] || say "what stays, --purge removes it: ${stays[*]}"
}

main() {
    read_words "$@"
    require_root
    require_to_be_alone
    remove_services
    remove_untouched_settings
    if [[ -L $COMMAND && $(readlink $COMMAND) == "$PREFIX"/* ]]; then
        step "remove $COMMAND" rm "$COMMAND"
    fi
    remove_folders "${CACHE[@]}"
    if [[ $PURGE ]]; then
        remove_folders "${STATE[@]}"
        remove "$SETTINGS" "$UNITS"/fasaco-edge*.service.d
    fi
    remove "$PREFIX"
    if [[ $CHANGES -eq 0 ]]; then
        say "nothing to do: fasaco_edge is not installed"
    elif [[ ! $DRY_RUN ]]; then
        say "fasaco_edge is uninstalled"
        tell_what_stays
    fi
    # This script may just have removed itself.
    exit 0
}

main "$@"
