# Units, the switch from one version to another, and back.
# shellcheck shell=bash disable=SC2154

# lay FILE PLACE: put a copy there in one go, unless it is there already.
lay() {
    cmp --silent "$1" "$2" && return
    step "write $2" lay_now "$1" "$2"
}

lay_now() {
    mkdir -p "$(dirname "$2")"
    install --mode=644 "$1" "$2.part"
    name_for_good "$2.part" "$2"
}

# lay_units VERSION: give systemd the units of that version, and none that it does not have.
lay_units() {
    local unit before=$CHANGES
    for unit in $DAEMON $RECORDER; do
        if [[ -f $(units_of "$1")/$unit ]]; then
            lay "$(units_of "$1")/$unit" "$UNITS/$unit"
        elif [[ -f $UNITS/$unit ]]; then
            step "stop and remove $unit, which version $1 does not have" drop_unit "$unit"
        fi
    done
    [[ $CHANGES -eq $before || $DRY_RUN ]] || ! systemd_runs || systemctl daemon-reload
}

# A dry run looks at the files that it would install.
units_of() {
    if [[ -d $PREFIX/$1/deploy ]]; then echo "$PREFIX/$1/deploy"; else echo "$HERE"; fi
}

drop_unit() {
    systemctl disable --now "$1" 2>/dev/null || true
    rm -f "$UNITS/$1"
}

# point LINK VERSION: let $PREFIX/LINK be that version; whoever looks finds the old one or the new.
point() {
    ln --symbolic --force --no-dereference "$2" "$PREFIX/.$1" &&
        mv --force --no-target-directory "$PREFIX/.$1" "$PREFIX/$1" && sync "$PREFIX"
}

# switch_to VERSION: link, units, and a service that has said READY and stays up; false if not.
switch_to() {
    point current "$1" && lay_units "$1" && systemctl --quiet enable $DAEMON || return
    [[ ! -f $UNITS/$RECORDER ]] || systemctl --quiet enable $RECORDER || return
    [[ $START ]] || return 0
    systemctl reset-failed $DAEMON 2>/dev/null || true
    SINCE=$(date +%s)
    systemctl restart $DAEMON && stays_up || return
    # A recorder that does not start harms nobody; it is told, and that is all.
    if [[ -f $UNITS/$RECORDER ]] && ! systemctl restart $RECORDER; then
        say "warning: $RECORDER did not start; journalctl -u $RECORDER tells why"
    fi
}

stays_up() {
    local first
    first=$(systemctl show --property=MainPID --value $DAEMON)
    sleep "$SETTLE_S"
    systemctl --quiet is-active $DAEMON &&
        [[ $(systemctl show --property=MainPID --value $DAEMON) == "$first" ]]
}

# switch FROM TO: switch, and back if the new version does not come up.
switch() {
    SWITCHING_FROM=$1 SWITCHING_TO=$2
    if switch_to "$2"; then
        SWITCHING_TO=
        [[ ! $1 || $1 == "$2" ]] || point previous "$1"
        return
    fi
    journalctl --unit=$DAEMON --since="@$SINCE" --lines=20 --no-pager --output=cat >&2 || true
    roll_back
}

roll_back() {
    local old=$SWITCHING_FROM new=$SWITCHING_TO
    SWITCHING_TO=
    if [[ ! $old || $old == "$new" ]]; then
        [[ $old ]] || take_back_first "$new"
        fail $ROLLED_BACK "version $new did not come up; above are the last lines of its journal" \
            "mend what is said there and run this again; nothing was running before"
    fi
    say "version $new did not come up: going back to $old"
    if switch_to "$old"; then
        NAME=$old
        prune
        fail $ROLLED_BACK "version $new did not come up; $old runs again" \
            "above are the last lines of the journal; \`journalctl -u $DAEMON\` has all of them"
    fi
    fail $ROLLED_BACK "version $new did not come up, and neither did $old" \
        "it is linked again; look into \`journalctl -u $DAEMON\`"
}

# take_back_first VERSION: leave no service behind that would try for ever to come up.
take_back_first() {
    systemctl disable --now $DAEMON 2>/dev/null || true
    drop_unit $RECORDER
    rm -f "$UNITS/$DAEMON" "$PREFIX/current"
    drop_version "$1"
    systemctl daemon-reload
}

# Remove all versions but the one that runs and the one before.
prune() {
    local folder name
    for folder in "$PREFIX"/*/; do
        name=$(basename "$folder")
        case $name in
        current | previous | '*' | "$NAME" | "$(version_of current)" | "$(version_of previous)") ;;
        *) step "remove version $name" drop_version "$name" ;;
        esac
    done
}

# drop_version VERSION: its folder. Kernels belong to sources, not to a version: what no version
# needs any more `fasaco-edge warmup --prune` removes.
drop_version() {
    # Else half of it may be left after a loss of power, and take itself for complete.
    rm -f "$PREFIX/$1/INSTALLED"
    [[ ! -d $PREFIX/$1 ]] || sync "$PREFIX/$1"
    rm -rf "${PREFIX:?}/$1"
}
