# What is to be installed, and whether it can be installed here.
# shellcheck shell=bash disable=SC2034,SC2154

# Python as root runs it: nothing of a user's, nor of the folder it is called in.
python() {
    "$PYTHON" -I "$@"
}

require_python() {
    "$PYTHON" -V >/dev/null 2>&1 || fail $NOT_POSSIBLE "there is no $PYTHON here" \
        "apt install python3 python3-venv, or name another with --python"
    python -c 'import sys; sys.exit(sys.version_info < (3, 11))' || fail $NOT_POSSIBLE \
        "fasaco_edge needs Python 3.11 or newer, $PYTHON is $("$PYTHON" -V 2>&1)" \
        "name a newer one with --python"
    python -c 'import venv' 2>/dev/null || fail $NOT_POSSIBLE \
        "$PYTHON cannot make virtual environments" "apt install python3-venv"
    # What ProtectHome= and PrivateTmp= hide from the service: its Python must not lie there.
    local home
    home=$(python -c 'import os, sys; print(os.path.realpath(sys.base_prefix))')
    if [[ $home/ =~ ^/(root|home|run/user|tmp)/ ]]; then
        fail $NOT_POSSIBLE "$PYTHON lies in $home, where a service cannot reach it" \
            "use the system's: --python /usr/bin/python3"
    fi
}

require_systemd() {
    systemctl --version >/dev/null 2>&1 || fail $NOT_POSSIBLE "there is no systemd here" \
        "elsewhere run the daemon by hand: pip install fasaco-edge, then fasaco-edge run"
    [[ ! $START ]] || systemd_runs || fail $NOT_POSSIBLE "systemd is installed but does not run" \
        "in a container or an image being built give --no-start: the service starts with the system"
}

# Set WHEELS to a release's wheels: those named, those beside this script, or those of this source.
find_wheels() {
    if [[ ! $WHEELS && -d $HERE/wheels ]]; then
        WHEELS=$HERE/wheels
    fi
    if [[ ! $WHEELS ]]; then
        make_wheels
        return
    fi
    if [[ -f $WHEELS/wheels/RELEASE ]]; then
        WHEELS=$WHEELS/wheels
    fi
    [[ -f $WHEELS/RELEASE ]] || fail $NOT_POSSIBLE "$WHEELS is no folder of wheels: no RELEASE in it" \
        "make one with \`make wheelhouse\` and give its path with --wheels"
}

make_wheels() {
    [[ -f $HERE/../pyproject.toml ]] || fail $NOT_POSSIBLE "there are no wheels beside $HERE" \
        "give a folder made by \`make wheelhouse\` with --wheels"
    if [[ $DRY_RUN ]]; then
        say "would download the wheels that this source tree needs, and stop here: with --wheels a"
        say "dry run tells more"
        exit 0
    fi
    say "downloading the wheels that this source tree needs"
    python -m venv "$SCRATCH/pip" >&2 || fail $NOT_POSSIBLE \
        "$PYTHON cannot make an environment with pip, see above" "apt install python3-venv"
    local with=()
    [[ $RECORDING ]] || with=(--without-recording)
    env --chdir="$HERE" "$SCRATCH/pip/bin/python" -E -s -m wheelhouse --out "$SCRATCH" \
        --python "$(python_version)" "${with[@]}" >"$SCRATCH/log" 2>&1 ||
        { tail -n 20 "$SCRATCH/log" >&2; fail $FAILED "the wheels could not be downloaded" \
            "without a network give a folder made by \`make wheelhouse\` with --wheels"; }
    WHEELS=$(echo "$SCRATCH"/fasaco-edge-*/wheels)
}

# Read RELEASE, and refuse what is for another computer.
read_release() {
    local key value
    while IFS='=' read -r key value; do
        case $key in
        VERSION) VERSION=$value ;;
        ARCH) ARCH=$value ;;
        PYTHON) FOR_PYTHON=$value ;;
        INSTALLED_MB) NEEDED_MB=$value ;;
        INSTALLED_MB_RECORDING) NEEDED_MB_RECORDING=$value ;;
        esac
    done <"$WHEELS/RELEASE"
    [[ $VERSION =~ ^[0-9][0-9A-Za-z.+]*$ && $NEEDED_MB =~ ^[0-9]+$ ]] || fail $NOT_POSSIBLE \
        "$WHEELS/RELEASE is damaged" "copy the release folder again"
    local here
    here=$(python -c 'import sysconfig; print(sysconfig.get_platform().removeprefix("linux-"))')
    [[ $here == "$ARCH" ]] || fail $NOT_POSSIBLE \
        "these wheels are for $ARCH, $PYTHON here is for $here" \
        "make wheelhouse ARCH=$here"
    [[ $(python_version) == "$FOR_PYTHON" ]] || fail $NOT_POSSIBLE \
        "these wheels are for Python $FOR_PYTHON, $PYTHON is $(python_version)" \
        "make wheelhouse TARGET_PYTHON=$(python_version), or name another Python with --python"
    LOCK=$WHEELS/requirements.txt
    if [[ $RECORDING && -f $WHEELS/requirements-record.txt ]]; then
        LOCK=$WHEELS/requirements-record.txt
        NEEDED_MB=$NEEDED_MB_RECORDING
    else
        RECORDING=
    fi
}

require_libc() {
    local libc
    libc=$(python -c 'import platform; print("".join(platform.libc_ver()))')
    [[ $libc == glibc* && $(printf '%s\n' 2.28 "${libc#glibc}" | sort -V | head -n 1) == 2.28 ]] ||
        fail $NOT_POSSIBLE "the wheels need glibc 2.28 or newer, here is ${libc:-another C library}" \
            "use Debian 10, Ubuntu 20.04 or newer"
}

require_room() {
    local place=$PREFIX free needed=$((NEEDED_MB + 50))
    while [[ ! -d $place ]]; do place=$(dirname "$place"); done
    free=$(df --output=avail --block-size=1000000 "$place" | tail -n 1)
    [[ $free -ge $needed ]] || fail $NOT_POSSIBLE \
        "$place has ${free// /} MB free, this version needs $needed MB" \
        "make room, or give --without-recording; uninstalling keeps state and configuration"
}

python_version() {
    python -c 'import sys; print(*sys.version_info[:2], sep=".")'
}

# What makes two builds of the same version the same: wheels, deployed files, Python.
fingerprint() {
    {
        cat "$LOCK"
        "$PYTHON" -V
        (cd "$HERE" && find . -path ./wheels -prune -o -path ./wheelhouse -prune -o -type f -print |
            LC_ALL=C sort | xargs -d '\n' sha256sum)
    } | sha256sum | cut -c 1-12
}
