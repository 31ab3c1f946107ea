#!/usr/bin/env bash
# Bakes of every kind, killed (SIGKILL) at MOMENTS (100) random moments each and gone on with, and then MOMENTS jobs of
# three ranks, of which one is killed, gone on with by one, two or five: all bytes are compared. An hour or more; KINDS:
# some alone. SEED: other moments.
source "$(dirname "$0")/common.sh"
read -ra kinds <<<"${KINDS:-}"
moments=${MOMENTS:-100}
tests/kill_and_resume.sh "$(readlink -f "$tool")" "$moments" "${kinds[@]}"
tests/ranks.sh "$tool" "$moments" view || [ $? -eq 77 ]
