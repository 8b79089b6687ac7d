#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# What is done on a robot, read by its sh from ssh: robot.sh STEP [ARGUMENT...]. Prints KEY=VALUE, or
# fails with `failed: KIND: SENTENCE`. TURBOPI_ROOT is put before all paths: for another root than /.
set -eu

root=${TURBOPI_ROOT:-}
config=$root/etc/turbopi/turbopi.conf
store=$root/var/lib/twinmill
scripts=$root/etc/turbopi/scripts

fail() { echo "failed: $1: $2" >&2; exit 1; }
as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi; }

may_be_root()
{
    as_root true 2>/dev/null ||
        fail "no permission" "sudo asks for a password: let this user be root without (sudo visudo)."
}

value_of() { sed -n "s/^$1 *= *\"\{0,1\}\([^\"#]*\)\"\{0,1\}.*/\1/p" "$config" 2>/dev/null | tail -n 1; }

# probe ARCHITECTURE NEEDED_KB: may the package go here at all?
probe()
{
    architecture=$(dpkg --print-architecture 2>/dev/null) ||
        fail "no dpkg" "is no Debian: Raspberry Pi OS is needed."
    [ "$architecture" = "$1" ] ||
        fail "wrong architecture" "its system is $architecture, the package is for $1: put the 64-bit Raspberry Pi OS on its card."
    may_be_root
    as_root mkdir -p "$store"
    free=$(df -Pk "$store" | awk 'NR == 2 { print $4 }')
    [ "$free" -ge "$2" ] || fail "no space" "$free KB are free, $2 KB are needed."
    camera=$(value_of camera)
    echo "camera=${camera:=/dev/video0}"
    case $camera in
        stub:*) ;;
        *) [ -e "$camera" ] || fail "no camera" "no $camera: is the camera plugged in?" ;;
    esac
    echo "installed=$(dpkg-query -W -f='${Version}' turbopi 2>/dev/null || true)"
    echo "robot_id=$(value_of robot_id)"
    echo "behavior=$(value_of behavior)"
    echo "upload=$(mktemp /tmp/turbopi.XXXXXX)"
}

# Installs the package at $1; its dependencies are named if they are missing.
dpkg_install()
{
    log=$(mktemp)
    if ! as_root dpkg --install "$1" >"$log" 2>&1; then
        why=$(grep -iE 'depends|error|cannot' "$log" | tail -n 1)
        rm -f "$log"
        fail "not installed" "dpkg: ${why:-failed}"
    fi
    rm -f "$log"
}

# install UPLOADED_FILE: the package that was installed until now is kept, for rollback.
install()
{
    may_be_root
    as_root mv "$1" "$store/new.deb"
    as_root chmod 644 "$store/new.deb"
    dpkg_install "$store/new.deb"
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
    dpkg_install "$store/previous.deb"
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

last_words() { as_root journalctl -u turbopi.service -n 3 -o cat --no-pager 2>/dev/null | tr '\n' ' '; }

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

# upload: a new file that this user may write.
upload() { echo "upload=$(mktemp /tmp/turbopi.XXXXXX)"; }

step=$1
shift
case $step in
    probe | install | rollback | configure | restart | script | upload) "$step" "$@" ;;
    *) fail "bad step" "$step" ;;
esac
