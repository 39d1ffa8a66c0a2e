#!/usr/bin/env bash
# Table of name, value, gap and seconds over all GTSPLIB instances of a directory.
#
#   benches/gtsplib.sh DIR [SEEDS [THREADS]]
#
# DIR holds *.gtsp and, for the gaps, bestknown.tsv (name, clusters, nodes, best value, …).
# Every instance is solved with seeds 1..SEEDS (5) on THREADS threads (1) within the limit of its
# size: 1 s up to 60 clusters, 5 s up to 115, 10 s up to 400, 60 s up to 2000, 120 s up to 5000, 180 s
# up to 10,000, 300 s above. A run ends early at the best known value.
# Printed: the median value and its gap [%], the worst gap, and the mean seconds of a run. Take a
# machine that does nothing else: the limits are wall-clock time.
set -euo pipefail

if [[ $# -lt 1 || ! -d $1 ]]; then
    sed -n '2,9s/^# \{0,1\}//p' "$0" >&2
    exit 2
fi
dir=$1
seeds=${2:-5}
threads=${3:-1}
manifest=$(cd "$(dirname "$0")/.." && pwd)/Cargo.toml
gtsplib() { cargo run --quiet --release --manifest-path "$manifest" --example gtsplib -- "$@"; }

cargo build --quiet --release --manifest-path "$manifest" --example gtsplib

printf 'name\tvalue\tgap%%\tworst%%\tseconds\n'
for file in "$dir"/*.gtsp; do
    name=$(basename "$file" .gtsp)
    clusters=$(sed -n 's/^GTSP_SETS *: *\([0-9]*\).*/\1/p' "$file" | head -n 1)
    best=$(awk -F '\t' -v name="$name" '$1 == name { print $4 }' "$dir/bestknown.tsv" 2>/dev/null || true)
    limit=300
    for size in 10000:180 5000:120 2000:60 400:10 115:5 60:1; do
        if ((clusters <= ${size%:*})); then limit=${size#*:}; fi
    done
    for ((seed = 1; seed <= seeds; seed++)); do
        gtsplib "$file" "$limit" "$seed" "$threads" ${best:+"$best"}
    done | sort -g | awk -v name="$name" -v best="$best" '
        { value[NR] = $1; seconds += $2 }
        function gap(v) { return best == "" ? "-" : sprintf("%.4f", 100 * (v - best) / best) }
        END {
            median = value[int((NR + 1) / 2)]
            printf "%s\t%s\t%s\t%s\t%.2f\n", name, median, gap(median), gap(value[NR]), seconds / NR
        }'
done
