#!/usr/bin/env bash
# Runs a command with its output in a file, and shows that output only if the command fails.
#
#   tools/quietly.sh LOG COMMAND [ARGUMENT...]
set -uo pipefail
log=$1
shift
mkdir -p "$(dirname "$log")"
"$@" >"$log" 2>&1
status=$?
if [ $status -ne 0 ]; then
    cat "$log" >&2
    echo "failed with status $status: $*" >&2
fi
exit $status
