#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# What is done on a robot, read by its sh from ssh: robot.sh STEP [ARGUMENT...]. Prints KEY=VALUE,
# or fails with `failed: KIND: SENTENCE`. TURBOPI_ROOT stands before all paths: another root than /.
set -eu
export LC_ALL=C DEBIAN_FRONTEND=noninteractive

root=${TURBOPI_ROOT:-}
unit=twinmill-robot.service
config=$root/etc/turbopi/turbopi.conf
store=$root/var/lib/twinmill
scripts=$root/etc/turbopi/scripts
secret=$root/etc/turbopi/key
tables=$root/etc/turbopi/behaviors.toml

fail() { echo "failed: $1: $2" >&2; exit 1; }
as_root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo -n "$@"; fi; }

may_be_root()
{
    as_root true 2>/dev/null ||
        fail "no permission" "sudo asks for a password: allow it without (sudo visudo)."
}

# The version of an installed package; nothing if it is not there or not whole.
version_of()
{
    dpkg-query -W -f='${db:Status-Status} ${Version}\n' "$1" 2>/dev/null | sed -n 's/^installed //p'
}

# Free space in KB, where there is least of it.
free_kb() { df -Pk "$root/var/lib" "$root/usr" /tmp | awk 'NR > 1 { print $4 }' | sort -n | head -n 1; }

# probe: what is it, and what is on it? Changes nothing.
probe()
{
    architecture=$(dpkg --print-architecture 2>/dev/null) ||
        fail "no dpkg" "is no Debian: Raspberry Pi OS is needed."
    may_be_root
    echo "architecture=$architecture"
    echo "release=$(sed -n 's/^VERSION_ID="\{0,1\}\([^"]*\)"\{0,1\}$/\1/p' "$root/etc/os-release")"
    echo "free_kb=$(free_kb)"
    echo "installed=$(version_of turbopi)"
    echo "others=$(others | tr '\n' ' ' | sed 's/ $//')"
    [ ! -e "$store/taken_over" ] || echo "taken_over=$(cut -d ' ' -f 1 "$store/taken_over" | tr '\n' ' ' | sed 's/ $//')"
    [ ! -e "$store/previous.deb" ] || echo "previous=$(dpkg-deb -f "$store/previous.deb" Version)"
}

# Services that hold a camera, a bus or lines, or whose command is the vendor's program. The vendor's
# network and its finder drive nothing.
others()
{
    {
        as_root find "$root"/proc/[0-9]*/fd -maxdepth 1 \( -lname '/dev/video*' -o -lname '/dev/i2c-*' \
            -o -lname '/dev/gpio*' -o -lname '/dev/ttyAMA*' \) 2>/dev/null |
            sed -n 's|.*/proc/\([0-9]*\)/fd/.*|\1|p' | sort -u | while read -r pid; do
                sed -n 's|.*:/system\.slice/\([^/]*\.service\).*|\1|p' "$root/proc/$pid/cgroup" 2>/dev/null || true
            done
        grep -lisE '^ExecStart=.*(turbopi|hiwonder)' "$root"/etc/systemd/system/*.service \
            "$root"/lib/systemd/system/*.service | sed 's|.*/||' || true
    } | sort -u | grep -vE "^($unit|.*wi-?fi.*|hw_find\.service)\$" | while read -r name; do
        if is active "$name" || is enabled "$name"; then echo "$name"; fi
    done || true
}

is() { systemctl --quiet "is-$1" "$2" 2>/dev/null; }

# take_over: stops and disables those services, and remembers what they were.
take_over()
{
    may_be_root
    as_root mkdir -p "$store"
    others | while read -r name; do
        active=no enabled=no
        if is active "$name"; then active=yes; fi
        if is enabled "$name"; then enabled=yes; fi
        echo "$name $active $enabled" | as_root tee -a "$store/taken_over" >/dev/null
        as_root systemctl disable --now "$name" >/dev/null 2>&1 ||
            fail "in use" "systemctl cannot stop $name: see journalctl -u $name on it."
    done
}

# hand_back: undoes take_over; our own service ends, its package stays.
hand_back()
{
    may_be_root
    [ -e "$store/taken_over" ] || fail "nothing taken" "no service of it was stopped by flash."
    as_root systemctl disable --now "$unit" >/dev/null 2>&1 || true
    while read -r name active enabled; do
        [ "$enabled" = no ] || as_root systemctl enable "$name" >/dev/null 2>&1 ||
            fail "not handed back" "systemctl cannot enable $name."
        [ "$active" = no ] || as_root systemctl start "$name" ||
            fail "not handed back" "systemctl cannot start $name: see journalctl -u $name on it."
    done <"$store/taken_over"
    as_root rm "$store/taken_over"
}

# What apt and dpkg say goes into $log.
apt()
{
    as_root env LC_ALL=C DEBIAN_FRONTEND=noninteractive apt-get --yes --no-remove \
        --no-install-recommends --reinstall --allow-downgrades -o DPkg::Lock::Timeout=60 \
        -o Acquire::Retries=1 -o Acquire::http::Timeout=15 -o Dpkg::Options::=--force-confdef \
        -o Dpkg::Options::=--force-confold "$@" >>"$log" 2>&1
}

# What stands in the way, in the words of apt and dpkg.
why()
{
    {
        sed -n 's/^ *\(turbopi[^ ]* : \)\{0,1\}\(Pre-\)\{0,1\}Depends: /needs /p' "$log"
        grep -A 1 '^dpkg: error processing' "$log" | grep -v '^--' | sed 's/ (--[a-z]*):$/:/' | tr '\n' ' '
        echo
        grep -ihE '^E: |no space left' "$log" | grep -vE 'Sub-process|unmet|broken packages|held broken|write log'
    } | sed 's/^ *//; s/ *$//' | grep . | awk '!seen[$0]++' | head -n 4 | paste -sd ';' - | sed 's/;/; /g' | cut -c 1-400
}

has_lists() { ls "$root"/var/lib/apt/lists/*_Packages* >/dev/null 2>&1; }

check_sound()
{
    unfinished=$(dpkg --audit 2>&1) || true
    [ -z "$unfinished" ] ||
        fail "apt broken" "dpkg has unfinished work from before: sudo dpkg --configure -a on it ($(echo "$unfinished" | tail -n 1 | sed 's/^ *//'))"
}

# Would it go? Changes nothing but, at need, the lists of packages.
check_installable()
{
    for attempt in first again; do
        : >"$log"
        ! apt --simulate install "$1" || return 0
        reason=$(why)
        [ "$attempt" = again ] || apt update || break
    done
    hint=
    has_lists || hint=" It has no lists of packages: connect it to the internet once."
    rm -f "$log"
    fail "not installable" "${reason:-apt said nothing}.$hint Nothing was changed."
}

packages() { dpkg-query -W -f='${db:Status-Status} ${Package}:${Architecture}\n' | sed -n 's/^installed //p' | sort; }

# undo PACKAGES_BEFORE STATE_BEFORE: leaves of a failed attempt nothing but its log. A configuration that was there before stays.
undo()
{
    if [ -e "$store/current.deb" ]; then
        as_root dpkg --force-confdef --force-confold --install "$store/current.deb" >/dev/null 2>&1 || true
    elif [ -n "$2" ]; then
        as_root dpkg --remove --force-remove-reinstreq turbopi >/dev/null 2>&1 || true
    else
        as_root dpkg --purge --force-remove-reinstreq turbopi >/dev/null 2>&1 || true
    fi
    new=$(packages | grep -vxF "$1" | grep -v '^turbopi:' || true)
    # shellcheck disable=SC2086  # one word each
    [ -z "$new" ] || as_root dpkg --purge $new >/dev/null 2>&1 || true
}

# Installs $1, or puts back what was there.
install_or_restore()
{
    check_sound
    log=$(mktemp)
    check_installable "$1"
    before=$(packages)
    known=$(dpkg-query -W -f='${db:Status-Status}' turbopi 2>/dev/null | grep -vx not-installed || true)
    : >"$log"
    if apt install "$1"; then
        rm -f "$log"
        return
    fi
    as_root cp "$log" "$store/install.log"
    reason=$(why)
    undo "$before" "$known"
    state="Nothing is left of it."
    [ -z "$(version_of turbopi)" ] || state="The package before was put back."
    [ -z "$(dpkg --audit 2>&1)" ] || state="It could not be undone: sudo dpkg --configure -a on it."
    rm -f "$log"
    fail "not installed" "${reason:-apt said nothing}. $state All that was said: $store/install.log on it."
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

# KEY VALUE as a line of TOML: a text stands in quotes, so that a # in it begins no comment.
line()
{
    if echo "$2" | grep -qxE -- '-?[0-9]+|true|false'; then
        printf '%s = %s\n' "$1" "$2"
    else
        printf '%s = "%s"\n' "$1" "$2"
    fi
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
        sed -i "/^[[:blank:]]*${key}[[:blank:]]*=/d" "$new"
        line "$key" "${pair#*=}" >>"$new"
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

# key UPLOADED_FILE: this robot's own, by which it knows its operator. Nobody but the program reads it.
key()
{
    may_be_root
    as_root chmod 600 "$1"
    as_root cp "$1" "$secret.new"
    rm -f "$1"
    as_root chmod 600 "$secret.new"
    if getent passwd turbopi >/dev/null; then
        as_root chown turbopi "$secret.new"
    fi
    as_root mv "$secret.new" "$secret"
}

# restart: and is it still there after a while? What the program before said is older than stopped_us.
restart()
{
    may_be_root
    as_root systemctl enable "$unit" >/dev/null 2>&1 || true
    as_root systemctl stop "$unit" || true
    echo "stopped_us=$(date +%s%6N)"
    as_root systemctl start "$unit" ||
        fail "service dies" "systemctl cannot start $unit: $(last_words)"
    sleep 2
    systemctl is-active --quiet "$unit" ||
        fail "service dies" "$unit does not stay up: $(last_words)"
}

last_words()
{
    as_root journalctl -u "$unit" -n 3 -o cat --no-pager 2>/dev/null | tr '\n' ' '
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
    device=$(turbopi --config "$config" --print-config | sed -n 's/^camera = "\(.*\)"$/\1/p')
    file=$(mktemp /tmp/turbopi.XXXXXX)
    said=$(mktemp)
    as_root systemctl stop "$unit"
    taken=yes
    as_root v4l2-ctl --device="$device" --stream-mmap --stream-to=- \
        --set-fmt-video="width=$1,height=$2,pixelformat=YUYV" \
        --stream-count="$3" --stream-skip="$4" >"$file" 2>"$said" || taken=
    restart
    reason=$(tail -n 1 "$said")
    rm -f "$said"
    if [ -z "$taken" ]; then
        rm -f "$file"
        fail "no camera" "v4l2-ctl: $reason"
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
        probe | take_over | hand_back | install | rollback | behaviors | configure | key | restart | frames | script | upload)
            "$step" "$@" ;;
        *) fail "bad step" "$step" ;;
    esac
}

# Read whole before anything runs: a program must not eat the rest of this text.
main "$@" </dev/null
