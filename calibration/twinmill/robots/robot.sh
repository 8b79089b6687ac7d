#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# What is done on a robot, read by its sh from ssh: robot.sh STEP [ARGUMENT...]. Prints KEY=VALUE,
# or fails with `failed: KIND: SENTENCE`. TURBOPI_ROOT stands before all paths: another root than /.
set -eu

root=${TURBOPI_ROOT:-}
config=$root/etc/turbopi/turbopi.conf
store=$root/var/lib/twinmill
scripts=$root/etc/turbopi/scripts
tables=$root/etc/turbopi/behaviors.toml

fail() { echo "failed: $1: $2" >&2; exit 1; }
as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi; }

may_be_root()
{
    as_root true 2>/dev/null ||
        fail "no permission" "sudo asks for a password: allow it without (sudo visudo)."
}

# probe [ARCHITECTURE] NEEDED_KB: may the package go here at all? Changes nothing.
probe()
{
    architecture=$(dpkg --print-architecture 2>/dev/null) ||
        fail "no dpkg" "is no Debian: Raspberry Pi OS is needed."
    [ -z "$1" ] || [ "$architecture" = "$1" ] ||
        fail "wrong architecture" "its system is $architecture, the package is for $1: does its card have the 64-bit Raspberry Pi OS?"
    may_be_root
    for folder in "$root/var/lib" /tmp; do
        free=$(df -Pk "$folder" | awk 'NR == 2 { print $4 }')
        [ "$free" -ge "$2" ] ||
            fail "no space" "$free KB are free in $folder, $2 KB are needed: remove something."
    done
    echo "installed=$(dpkg-query -W -f='${Version}' turbopi 2>/dev/null || true)"
    [ ! -e "$store/previous.deb" ] || echo "previous=$(dpkg-deb -f "$store/previous.deb" Version)"
}

# The configuration that is there stays; no question is asked. What the package depends on is
# fetched, if there is a network that has it.
dpkg_install()
{
    as_root dpkg --force-confdef --force-confold --install "$1" >"$log" 2>&1 && return
    grep -qi 'dependency problems' "$log" || return
    as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get --yes --no-remove --no-install-recommends --fix-broken install >"$log.apt" 2>&1
}

# Installs $1, or puts back what was there.
install_or_restore()
{
    log=$(mktemp)
    if dpkg_install "$1"; then
        rm -f "$log" "$log.apt"
        return
    fi
    why=$(grep -iE 'depends|error|cannot|no space' "$log" | tail -n 1 | sed 's|^dpkg: ||')
    back=
    if [ -e "$store/current.deb" ] && dpkg_install "$store/current.deb"; then
        back=' The package before was put back.'
    fi
    rm -f "$log" "$log.apt"
    fail "not installed" "dpkg: ${why:-failed}.$back"
}

# install UPLOADED_FILE: the package that was installed until now is kept, for rollback.
install()
{
    may_be_root
    as_root mkdir -p "$store"
    as_root cp "$1" "$store/new.deb"
    rm -f "$1"
    as_root chmod 644 "$store/new.deb"
    install_or_restore "$store/new.deb"
    if [ -e "$store/current.deb" ] && ! cmp -s "$store/new.deb" "$store/current.deb"; then
        as_root mv "$store/current.deb" "$store/previous.deb"
    fi
    as_root mv "$store/new.deb" "$store/current.deb"
}

# rollback: changes places with the package before, so that a second one goes back again.
rollback()
{
    may_be_root
    [ -e "$store/previous.deb" ] ||
        fail "no previous" "no previous package is kept on it: install one with --package."
    install_or_restore "$store/previous.deb"
    as_root mv "$store/current.deb" "$store/other.deb"
    as_root mv "$store/previous.deb" "$store/current.deb"
    as_root mv "$store/other.deb" "$store/previous.deb"
}

# configure KEY=VALUE...: the program itself says if the new configuration is right; then it is
# renamed into place.
configure()
{
    may_be_root
    new=$(mktemp)
    cat "$config" >"$new" 2>/dev/null || true
    for pair in "$@"; do
        key=${pair%%=*}
        sed -i "/^$key *=/d" "$new"
        echo "$key = ${pair#*=}" >>"$new"
    done
    if ! said=$(turbopi --config "$new" --print-config 2>&1 >/dev/null); then
        rm -f "$new"
        fail "bad configuration" "$said"
    fi
    chmod 644 "$new"
    as_root cp "$new" "$config.new"
    as_root mv "$config.new" "$config"
    rm -f "$new"
}

# behaviors UPLOADED_FILE: tables that commands can name; the program itself says if they are right.
behaviors()
{
    may_be_root
    if ! said=$(turbopi --config /dev/null --set "behaviors=$1" --print-config 2>&1 >/dev/null); then
        rm -f "$1"
        fail "bad behaviours" "$said"
    fi
    chmod 644 "$1"
    as_root cp "$1" "$tables.new"
    as_root mv "$tables.new" "$tables"
    rm -f "$1"
}

# restart: and is it still there after a while?
restart()
{
    may_be_root
    as_root systemctl restart turbopi.service ||
        fail "service dies" "systemctl cannot start turbopi.service: $(last_words)"
    sleep 2
    systemctl is-active --quiet turbopi.service ||
        fail "service dies" "turbopi.service does not stay up: $(last_words)"
}

last_words()
{
    as_root journalctl -u turbopi.service -n 3 -o cat --no-pager 2>/dev/null | tr '\n' ' '
}

# script NAME UPLOADED_FILE: for characterise.
script()
{
    may_be_root
    as_root mkdir -p "$scripts"
    as_root cp "$2" "$scripts/.new"
    as_root chmod 644 "$scripts/.new"
    as_root mv "$scripts/.new" "$scripts/$1"
    rm -f "$2"
}

# frames WIDTH HEIGHT COUNT SKIP: raw YUYV of the camera; the robot's program stands aside.
frames()
{
    may_be_root
    command -v v4l2-ctl >/dev/null || fail "no v4l2-ctl" "install v4l-utils on it."
    device=$(sed -n 's/^camera *= *"\{0,1\}\([^"# ]*\).*/\1/p' "$config" | tail -n 1)
    file=$(mktemp /tmp/turbopi.XXXXXX)
    log=$(mktemp)
    as_root systemctl stop turbopi.service
    taken=yes
    as_root v4l2-ctl --device="${device:-/dev/video0}" --stream-mmap --stream-to=- \
        --set-fmt-video="width=$1,height=$2,pixelformat=YUYV" \
        --stream-count="$3" --stream-skip="$4" >"$file" 2>"$log" || taken=
    restart
    why=$(tail -n 1 "$log")
    rm -f "$log"
    if [ -z "$taken" ]; then
        rm -f "$file"
        fail "no camera" "v4l2-ctl: $why"
    fi
    echo "frames=$file"
}

# upload: a new file that this user may write.
upload() { echo "upload=$(mktemp /tmp/turbopi.XXXXXX)"; }

main()
{
    step=$1
    shift
    case $step in
        probe | install | rollback | behaviors | configure | restart | frames | script | upload) "$step" "$@" ;;
        *) fail "bad step" "$step" ;;
    esac
}

# Read whole before anything runs: a program must not eat the rest of this text.
main "$@" </dev/null
