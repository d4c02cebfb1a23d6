#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Builds the browser planner (client/web) into build/web: what `tissueform-gateway --web build/web` gives out, and the page that
# `tissueform export` fills. Does nothing where that is newer than all it is made from.
#
#   deploy/build_web.sh [--tools]      --tools: packages and generated messages only, as tests need them
#
# Fetches what client/web/package-lock.json names, from npm's registry, and Debian's nodejs and npm where there is no Node
# of version 18 or later.
set -euo pipefail
cd "$(dirname "$0")/.."

web=client/web
generated=$web/src/generated
target=build/web

major=$(node --version 2>/dev/null | sed -n 's/^v\([0-9]*\)\..*/\1/p' || true)
if [[ ${major:-0} -lt 18 ]] || ! command -v npm >/dev/null; then
  deploy/install_packages.sh protocol
fi
command -v protoc >/dev/null || deploy/install_packages.sh build

# Whether $1 is there and nothing of the others was changed after it.
is_newer() {
  local made=$1
  shift
  [[ -e $made && -z $(find "$@" -newer "$made" -print -quit) ]]
}

if ! is_newer "$web/node_modules/.package-lock.json" "$web/package-lock.json"; then
  (cd "$web" && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error)
fi

if ! is_newer "$generated/made" proto/tissueform/v1 deploy/build_web.sh "$web/package-lock.json"; then
  google_protos=
  for folder in "${GOOGLE_RPC_PROTOS:-}" /usr/share/gocode/src/github.com/gogo/googleapis /usr/share/googleapis; do
    if [[ -z $google_protos && -e $folder/google/rpc/error_details.proto ]]; then
      google_protos=$folder
    fi
  done
  if [[ -z $google_protos ]]; then
    echo "build_web.sh: google/rpc/error_details.proto is missing: install golang-github-gogo-googleapis-dev, or set GOOGLE_RPC_PROTOS" >&2
    exit 1
  fi
  rm -rf "$generated"
  mkdir -p "$generated"
  protoc --plugin=protoc-gen-es="$web/node_modules/.bin/protoc-gen-es" --es_out="$generated" --es_opt=target=ts \
    -I proto -I "$google_protos" proto/tissueform/v1/*.proto \
    "$google_protos"/google/rpc/status.proto "$google_protos"/google/rpc/error_details.proto
  touch "$generated/made"
fi

# The evaluator of prepared answers, for browsers.
evaluator=(core/mechanics/answer_evaluator/*.cc core/mechanics/contact/*.cc core/base/instruction_set.cc)
evaluator_sources=("$web/wasm" core/mechanics/answer_evaluator core/mechanics/contact core/base/instruction_set.h core/base/instruction_set.cc)
if ! is_newer "$generated/answer_evaluator.wasm" "$generated/made" "${evaluator_sources[@]}"; then
  # wasm-ld is in Debian's lld, the standard library in libc++-14-dev-wasm32 and wasi-libc.
  if ! command -v clang++ >/dev/null || ! command -v wasm-ld >/dev/null || [[ ! -e /usr/lib/wasm32-wasi/libc++.a ]]; then
    deploy/install_packages.sh build web
  fi
  compile=(clang++ --target=wasm32-wasi -msimd128 -std=c++20 -fno-exceptions -fno-rtti -ffunction-sections -fdata-sections
    -Wall -Wextra -Werror -I.)
  objects=$(mktemp -d)
  # Small where it does not count for the time of a frame: the page has a limit (client/web/bundle_size.mjs).
  for source in "$web/wasm/answer_evaluator.cc" "${evaluator[@]}"; do
    case $source in
      */answer_bytes.cc | */answer_checks.cc | */answer_sizes.cc | */instruction_set.cc) optimize=-Oz ;;
      */lcp_solver.cc | */contact_forces.cc | */pose_range.cc) optimize=-Os ;;
      *) optimize=-O2 ;;
    esac
    "${compile[@]}" $optimize -c -o "$objects/${source//\//_}.o" "$source"
  done
  clang++ --target=wasm32-wasi -mexec-model=reactor -stdlib=libc++ -Wl,--gc-sections,--strip-all,--stack-first,-z,stack-size=262144 \
    -o "$generated/answer_evaluator.wasm" "$objects"/*.o
  rm -r "$objects"
fi

if [[ ${1:-} == --tools ]] || is_newer "$target/moving-file.html" "$web/src" "${evaluator_sources[@]}" "$web/index.html" "$web/moving-file.template.html" "$web/build_moving_file.mjs" "$web/public" "$web/vite.config.ts" "$web/package-lock.json"; then
  exit 0
fi
(cd "$web" && npm run --silent build)
