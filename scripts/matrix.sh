#!/bin/sh
# `make demo` and `make test` on every Python that is supported, each in an environment of its own,
# and once with the oldest libraries that setup.py allows; then a table. Called by `make matrix`.
#
#     scripts/matrix.sh               all of them
#     scripts/matrix.sh 3.12 lowest   these
cd "$(dirname "$0")/.." || exit 1
logs=build/matrix
mkdir -p "$logs"

# The interpreter of a version: on the PATH, or among those of pyenv.
interpreter() {
    for found in "$(command -v "python$1")" "$HOME"/.pyenv/versions/"$1".*/bin/python; do
        if [ -x "$found" ] && "$found" -c '' 2>/dev/null; then
            echo "$found"
            return
        fi
    done
}

[ $# -gt 0 ] || set -- 3.10 3.11 3.12 3.13 lowest
failed=0
table=
for name; do
    version=$name
    options=
    if [ "$name" = lowest ]; then
        # the last Python that has wheels of all of them
        version=3.11
        python3 scripts/lower_bounds.py > "$logs/lowest.txt" || exit 1
        options="--constraint $logs/lowest.txt"
    fi
    python=$(interpreter "$version")
    for what in demo test; do
        log=$logs/$name-$what.log
        begun=$(date +%s)
        if [ -z "$python" ]; then
            result="no Python $version"
            failed=1
        elif make "$what" PYTHON="$python" VENV=".venv-$name" PIP_OPTIONS="$options" \
            > "$log" 2>&1; then
            result=passed
        else
            result="failed: $log"
            failed=1
        fi
        line=$(printf '%-7s %-5s %5d s  %s' "$name" "$what" $(($(date +%s) - begun)) "$result")
        echo "$line"
        table="$table$line
"
    done
done
printf '\n%s' "$table" | tee "$logs/table.txt"
exit $failed
