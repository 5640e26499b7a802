# A version's folder: built where it stays, tried out before anything points to it.
# shellcheck shell=bash disable=SC2154

# What is complete says so in the file INSTALLED, which is written last, once all else is on the disk.
is_complete() {
    [[ -f $PREFIX/$1/INSTALLED ]]
}

fingerprint_of() {
    cut -d ' ' -f 2 "$PREFIX/$1/INSTALLED" 2>/dev/null || true
}

# Set NAME, the folder of this build; another build of the same version is left alone.
name_version() {
    local print
    print=$(fingerprint)
    NAME=$VERSION
    if is_complete "$NAME" && [[ $(fingerprint_of "$NAME") != "$print" ]]; then
        NAME=$VERSION-$print
    fi
    FINGERPRINT=$print
}

build_version() {
    local place=$PREFIX/$NAME
    BUILDING=$place
    rm -rf "$place"
    mkdir -p "$PREFIX"
    python -m venv --without-pip "$place"
    python -m zipfile --extract "$WHEELS"/pip-*.whl "$SCRATCH/pip"
    pip install --no-index --require-hashes --find-links "$WHEELS" --requirement "$LOCK" ||
        fail $FAILED "the wheels in $WHEELS could not be installed, see above" \
            "copy the release folder again: a file is missing or damaged"
    # As root runs it, too: it imports nothing but what is installed here.
    sed --in-place '1s/$/ -I/' "$place/bin/fasaco-edge"
    mkdir "$place/deploy"
    (cd "$HERE" && find . -path ./wheels -prune -o -path ./wheelhouse -prune -o -type f -print0 |
        xargs -0 cp --parents --target-directory="$place/deploy")
    [[ $RECORDING ]] || rm -f "$place/deploy/$RECORDER"
    chmod -R u=rwX,go=rX "$place"
    # A release folder may have come on a stick that knows no modes.
    chmod a+x "$place/deploy/install.sh" "$place/deploy/uninstall.sh"
}

# The release's own pip; nobody's settings of pip decide what is installed here, nor need root have a home.
pip() {
    HOME=$SCRATCH PIP_CONFIG_FILE=/dev/null "$PREFIX/$NAME/bin/python" -I "$SCRATCH/pip/pip" \
        --isolated --quiet --disable-pip-version-check "$@"
}

# Run a program of the new version as the service's user, in the service's cache: only what that
# user has compiled is trusted by the service, and only what it may read is of use to it.
as_service() {
    systemd-run --quiet --wait --pipe --collect --service-type=exec \
        --property=DynamicUser=yes --property=User=fasaco-edge \
        --property=CacheDirectory=fasaco-edge --property=PrivateNetwork=yes \
        --property=ProtectHome=yes --property=Nice=10 --property=CPUWeight=20 \
        --setenv=NUMBA_CACHE_DIR=$KERNELS --setenv=HOME=/nonexistent -- "$@" </dev/null
}

try_version() {
    local program=$PREFIX/$NAME/bin/fasaco-edge config=$SETTINGS/config.yaml said
    [[ -f $config ]] || config=$PREFIX/$NAME/deploy/$EXAMPLE
    if [[ ! $START ]]; then
        HOME=$SCRATCH NUMBA_CACHE_DIR=$SCRATCH "$program" check-config "$config" >"$SCRATCH/said" 2>&1 ||
            not_fit "its own check of $config"
        return
    fi
    as_service "$program" check-config "$config" >"$SCRATCH/said" 2>&1 || not_fit "its check of $config"
    as_service "$program" warmup >"$SCRATCH/said" 2>&1 || not_fit "compiling its kernels"
}

not_fit() {
    tail -n 20 "$SCRATCH/said" >&2
    local old
    old=$(version_of current)
    fail $NOT_FIT "version $NAME did not pass $1, see above; nothing was switched" \
        "${old:+version $old runs on; }mend what is said above and run this again"
}
