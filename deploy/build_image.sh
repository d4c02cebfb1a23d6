#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Builds the image of the Dockerfile with Debian's buildah, where no container engine and no registry is at hand, starts
# server and gateway from it, asks both, holds deploy/compose.yaml against its programs, and prints how large it is and how
# long that took.
#
#   deploy/build_image.sh [--packages FOLDER] [IMAGE.tar]
#
# --packages: takes deploy/build_packages.sh's packages from there instead of compiling in a builder; the image is the same.
# IMAGE.tar: writes the image for `docker load`. JOBS: compilers at once.
#
# Needs root, docker-compose, buildah and mmdebstrap (which makes the bases debian:12 and debian:12-slim), a Debian mirror, and npm's
# registry for the planner. Takes two minutes with packages, and ten and 8 GB without: not a part of .ci/run.
set -euo pipefail
cd "$(dirname "$0")/.."

packages=
if [[ ${1:-} == --packages ]]; then
  packages=$(realpath "$2")
  shift 2
fi
archive=${1:-}
scratch=$(mktemp -d)
export STORAGE_DRIVER=vfs BUILDAH_ISOLATION=chroot
tool=(buildah --root "$scratch/storage" --runroot "$scratch/run")
started=()

finish() {
  local pid
  for pid in "${started[@]}"; do kill "$pid" 2>/dev/null || true; done
  wait || true  # their files keep the storage from being unmounted
  "${tool[@]}" rm --all >/dev/null 2>&1 || true
  umount "$scratch/storage/overlay" 2>/dev/null || true  # where buildah has mounted it upon itself
  rm -rf --one-file-system "$scratch"
}
trap finish EXIT

fail() {
  echo "build_image.sh: $*" >&2
  tail -n 40 "$scratch"/*.log >&2 2>/dev/null || true
  exit 1
}

# make_base NAME [OPTIONS of mmdebstrap]: what a registry has under this name, as near as Debian's archive gives it.
make_base() {
  local name=$1 container
  shift
  mmdebstrap --quiet --variant=minbase --include=ca-certificates "$@" bookworm "$scratch/base.tar" >"$scratch/base.log" 2>&1 || fail "no base $name"
  container=$("${tool[@]}" from scratch)
  "${tool[@]}" add --quiet "$container" "$scratch/base.tar" / >/dev/null
  "${tool[@]}" commit --quiet --rm "$container" "docker.io/library/$name" >/dev/null
  rm "$scratch/base.tar"
}

begin=$SECONDS
make_base debian:12-slim --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-include=/usr/share/doc/*/copyright' \
  --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/locale/*'
context=$PWD
file=Dockerfile
if [[ -n $packages ]]; then
  context=$scratch/context
  file=$context/Dockerfile
  mkdir -p "$context/packages"
  cp "$packages"/tissueform-{server,gateway}_*.deb "$context/packages/"
  # The last stage alone, with packages from here.
  sed -n '/^FROM debian:12-slim/,$p' Dockerfile | sed 's|^COPY --from=builder /packages/|COPY packages/|' >"$file"
else
  make_base debian:12
fi
based=$((SECONDS - begin))

begin=$SECONDS
authorities=()
# npm in the builder trusts the authorities that this machine trusts.
if [[ -z $packages && -e /etc/ssl/certs/ca-certificates.crt ]]; then
  authorities=(--secret "id=authorities,src=/etc/ssl/certs/ca-certificates.crt")
fi
"${tool[@]}" build --format docker --pull-never "${authorities[@]}" ${JOBS:+--build-arg "JOBS=$JOBS"} --tag tissueform --file "$file" "$context" >"$scratch/build.log" 2>&1 || fail "it is not built"
built=$((SECONDS - begin))

container=$("${tool[@]}" from --pull-never tissueform)
config=$("${tool[@]}" inspect --type image --format '{{.Docker.Config.Entrypoint}} {{.Docker.Config.User}} {{.Docker.Config.Healthcheck.Test}}' tissueform)
[[ $config == "[tissueform-server] tissueform [CMD bash -c "* ]] || fail "entry point, user or health check are not as the Dockerfile says: $config"

# start NAME COMMAND...: in a container of the image, on this machine's loopback; sets `address`.
start() {
  local name=$1 tries
  shift
  touch "$scratch/$name.out"
  "${tool[@]}" run --user tissueform "$container" -- "$@" >"$scratch/$name.out" 2>"$scratch/$name.log" &
  started+=($!)
  for ((tries = 0; tries < 300; ++tries)); do
    address=$(sed -n 's/^listening on //p' "$scratch/$name.out")
    [[ -z $address ]] || return 0
    kill -0 "${started[-1]}" 2>/dev/null || break
    sleep 0.1
  done
  fail "$name does not start"
}
start server tissueform-server --port 0
server=$address
start gateway tissueform-gateway --server "$server" --listen 127.0.0.1:0 --web /usr/share/tissueform/web
gateway=$address
/usr/bin/python3 deploy/ask_health.py "$server" "$gateway" || fail "they do not answer"

# Of its files, as every engine unpacks them.
mount=$("${tool[@]}" mount "$container")
for package in tissueform-server tissueform-gateway; do
  [[ -s $mount/usr/share/tissueform/sbom/$package.spdx.json ]] || fail "$package has no bill of materials"
done
tests/scripts/check_compose.py "$mount/usr/bin" || fail "deploy/compose.yaml does not fit the image"
size=$(du -sm "$mount" | cut -f 1)
echo "image: $size MB unpacked; bases in $based s, image in $built s; server and gateway from it answer"
if [[ -n $archive ]]; then
  "${tool[@]}" push --quiet tissueform "docker-archive:$archive:tissueform:latest"
  echo "written: $archive ($(du -m "$archive" | cut -f 1) MB), for docker load"
fi
