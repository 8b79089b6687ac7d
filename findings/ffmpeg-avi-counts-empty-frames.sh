#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# ffmpeg 5.1 (Debian 12): the header of an AVI counts frames that nobody can read.
#
# Guess: AVI's header holds how many frames there are, as MP4's does; Matroska's holds none.
# Seen, of a webcam's 100 frames whose second half comes at half the rate: nb_frames is 149, since each gap
#   is filled with chunks of no bytes, which are counted and never decoded. MP4 says 100. A film is whole if
#   its last stamp reaches its duration, not if its frames reach that count.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
stamp="round(if(lt(N,50),N/30,50/30+(N-50)/15)/TB)"
for end in avi mp4; do
    ffmpeg -loglevel error -f lavfi -i "testsrc=size=160x120:rate=30,setpts='$stamp'" -frames:v 100 \
        -vsync vfr -c:v mpeg4 "film.$end"
done

# What is said of a film: `nb_frames`, or `nb_read_frames` after decoding all.
said()
{
    ffprobe -v error -count_frames -select_streams v -show_entries "stream=$1" -of csv=p=0 "$2"
}

for end in avi mp4; do
    echo "$end: header $(said nb_frames film.$end), decoded $(said nb_read_frames film.$end)"
done
[ "$(said nb_frames film.avi)" -eq 149 ]
[ "$(said nb_read_frames film.avi)" -eq 100 ]
[ "$(said nb_frames film.mp4)" -eq 100 ]
[ "$(said nb_read_frames film.mp4)" -eq 100 ]
