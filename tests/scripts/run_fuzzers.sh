#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Builds the fuzz targets with clang, AddressSanitizer and UndefinedBehaviorSanitizer and runs each for a while,
# beginning with tests/fuzz/corpus. Fails when one finds a fault; the input lies in the build folder then: put it into the
# corpus with the repair.
#
#   tests/scripts/run_fuzzers.sh [SECONDS]     for each target (default 20)
#
# TISSUEFORM_BUILD_DIR  build folder (default: build/fuzz)
# JOBS                  compilers at once (default: one a core)
# FUZZ_SEED             where the search begins (default 1: a second run repeats the first; 0: anywhere)
set -euo pipefail
cd "$(dirname "$0")/../.."

seconds=${1:-20}
build_dir=${TISSUEFORM_BUILD_DIR:-$PWD/build/fuzz}
declare -A corpora=([FuzzPlan]=plan [FuzzMeshValidation]=mesh_validation [FuzzMeshPayload]=mesh_payload
  [FuzzDicomSeries]=dicom_series [FuzzVolumeHeader]=volume_header [FuzzLabels]=labels [FuzzRecipe]=recipe [FuzzMeditLines]=medit
  [FuzzDisplacements]=displacements [FuzzStoreRecord]=store_record [FuzzDeformStream]=deform_stream [FuzzCaseFile]=case_file
  [FuzzCaseUpload]=case_upload [FuzzAnswers]=answers [FuzzSocketFrame]=socket_frame [FuzzWebRequest]=web_request
  [FuzzMultipart]=multipart [FuzzInstanceHeader]=instance_header
  [FuzzZip]=zip [FuzzTransform]=transform [FuzzMarkups]=markups
  [FuzzGatewayConnection]=gateway_connection)

cmake -S . -B "$build_dir" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_CXX_FLAGS_RELWITHDEBINFO="-O1 -g1" \
  -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++ \
  -DTISSUEFORM_FUZZERS=ON -DTISSUEFORM_WARNINGS_AS_ERRORS=OFF -DTISSUEFORM_SANITIZE=address,undefined,fuzzer-no-link \
  > "$build_dir.log" 2>&1 || { cat "$build_dir.log" >&2; exit 1; }
cmake --build "$build_dir" --parallel "${JOBS:-$(nproc)}" --target "${!corpora[@]}"

for target in "${!corpora[@]}"; do
  found=$build_dir/corpus/${corpora[$target]}
  mkdir -p "$found"
  printf '== %s for %s s\n' "$target" "$seconds"
  # Slow inputs count as faults: no file of that size may take 5 s.
  "$build_dir/bin/$target" -seed="${FUZZ_SEED:-1}" -max_total_time="$seconds" -timeout=5 -rss_limit_mb=4096 -max_len=65536 -print_final_stats=1 \
    -artifact_prefix="$build_dir/" "$found" "tests/fuzz/corpus/${corpora[$target]}"
done
