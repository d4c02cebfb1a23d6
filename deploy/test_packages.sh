#!/usr/bin/env bash
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
#
# Installs the server's and the gateway's packages into a fresh Debian 12, starts both, asks them as clients do, installs
# them again over a changed configuration, removes and purges them.
#
#   deploy/test_packages.sh [--pacs] [FOLDER_OF_PACKAGES]     build/packages; made where they are missing
#
# --pacs: tools and bridge, too: a head that DCMTK's storescu sends to what was installed becomes a case on the server.
#
# Needs root, mmdebstrap and a Debian mirror. Takes half a minute to two, most of it for the mirror, and with --pacs,
# which needs 2 GB, some more: not a part of .ci/run.
set -euo pipefail
cd "$(dirname "$0")/.."

if [[ ${TISSUEFORM_OWN_MOUNTS:-} != yes ]]; then
  # What is mounted goes with this process.
  TISSUEFORM_OWN_MOUNTS=yes exec unshare --mount --propagation private "$0" "$@"
fi

installed=(tissueform-server tissueform-gateway)
if [[ ${1:-} == --pacs ]]; then
  installed+=(tissueform-tools tissueform-pacs)
  shift
fi
packages=${1:-build/packages}
if ! compgen -G "$packages/${installed[-1]}_*.deb" >/dev/null; then
  deploy/build_packages.sh "$packages" "${installed[@]}" >/dev/null
fi
files=()
for package in "${installed[@]}"; do files+=("$packages/$package"_*.deb); done
scratch=$(mktemp -d)
root=$scratch/root
started=()

finish() {
  local pid
  for pid in "${started[@]}"; do kill "$pid" 2>/dev/null || true; done
  umount "$root/proc" 2>/dev/null || true
  rm -rf --one-file-system "$scratch"
}
trap finish EXIT

fail() {
  echo "test_packages.sh: $*" >&2
  cat "$scratch"/*.log >&2 2>/dev/null || true
  exit 1
}
ok() { echo "ok: $*"; }
inside() { DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"; }

if command -v lintian >/dev/null; then
  # The project has no address for mail yet. Programs that `tissueform` starts have no manual pages of their own.
  lintian --allow-root --fail-on error,warning --suppress-tags bogus-mail-host,bogus-mail-host-in-debian-changelog,no-manual-page \
    "${files[@]}" || fail "lintian has found something"
  ok "lintian finds nothing"
fi

mmdebstrap --quiet --variant=apt bookworm "$root" >"$scratch/debootstrap.log" 2>&1 || fail "no fresh root"
mount -t proc proc "$root/proc"
cp "${files[@]}" "$root/tmp/"
inside apt-get update -qq >"$scratch/install.log" 2>&1 || fail "no mirror"
inside sh -c 'apt-get install -y -qq --no-install-recommends /tmp/tissueform-*.deb' >"$scratch/install.log" 2>&1 || fail "they cannot be installed"
ok "installed into a fresh Debian 12 ($(du -sm --exclude=proc "$root" | cut -f 1) MB with it)"
[[ $(inside stat -c '%a %U:%G' /var/lib/tissueform) == "700 tissueform:tissueform" ]] || fail "the data folder is not the server's alone"
for package in tissueform-server tissueform-gateway; do
  [[ -L $root/etc/systemd/system/multi-user.target.wants/$package.service ]] || fail "$package.service is not enabled"
done
if [[ ${installed[*]} == *tissueform-pacs* ]]; then
  [[ $(inside stat -c '%a %U:%G' /var/lib/tissueform-pacs) == "700 tissueform-pacs:tissueform-pacs" ]] || fail "the bridge's folder is not its alone"
  [[ ! -L $root/etc/systemd/system/multi-user.target.wants/tissueform-pacs.service ]] || fail "the bridge starts before it knows a PACS"
fi
ok "users, data folder and services are there"

# start NAME USER COMMAND...: sets `address` to what it listens on.
start() {
  local name=$1 user=$2 tries
  shift 2
  touch "$scratch/$name.out"
  chroot --userspec="$user:$user" "$root" "$@" >"$scratch/$name.out" 2>"$scratch/$name.log" &
  started+=($!)
  for ((tries = 0; tries < 300; ++tries)); do
    address=$(sed -n 's/^\(listening\|receiving\) on //p' "$scratch/$name.out")
    [[ -z $address ]] || return 0
    kill -0 "${started[-1]}" 2>/dev/null || break
    sleep 0.1
  done
  fail "$name does not start"
}
start server tissueform tissueform-server --config /etc/tissueform/server.ini --port 0
server=$address
start gateway tissueform-gateway tissueform-gateway --config /etc/tissueform/gateway.ini --server "$server" --listen 127.0.0.1:0
gateway=$address

/usr/bin/python3 deploy/ask_health.py "$server" "$gateway" || fail "they do not answer"
ok "server and gateway serve from what was installed"
inside runuser -u tissueform -- tissueform-server backup /tmp/backup --config /etc/tissueform/server.ini >/dev/null || fail "no backup of the running server"
ok "the running server is backed up by its own user"

if [[ ${installed[*]} == *tissueform-pacs* ]]; then
  bridge=(tissueform-pacs run --config /etc/tissueform/pacs.ini --server "$server" --listen 127.0.0.1:0 --review-listen 127.0.0.1:0 --quiet-seconds 2)
  start bridge tissueform-pacs "${bridge[@]}"
  /usr/bin/python3 -B deploy/pacs/head_series.py "$scratch/series" >/dev/null
  storescu -aet SCANNER -aec TISSUEFORM +sd "${address%:*}" "${address##*:}" "$scratch/series" 2>"$scratch/storescu.log" || fail "the bridge takes no images"
  for ((tries = 0; tries < 600; ++tries)); do
    bridge_status=$(inside runuser -u tissueform-pacs -- tissueform-pacs status --json --config /etc/tissueform/pacs.ini)
    [[ $bridge_status != *'"state": "published"'* ]] || break
    sleep 0.5
  done
  [[ $bridge_status == *'"state": "published"'* ]] || fail "no case of what was sent: $bridge_status"
  ok "what storescu sends to the bridge becomes a case on the server"
fi

for ((i = ${#started[@]} - 1; i >= 0; --i)); do
  pid=${started[i]}
  kill -TERM "$pid"
  wait "$pid" || fail "one of them does not end well"
done
started=()
ok "all end with exit code 0"

echo '# ours' >>"$root/etc/tissueform/server.ini"
inside sh -c 'apt-get install -y -qq --reinstall /tmp/tissueform-*.deb' >"$scratch/install.log" 2>&1 || fail "they cannot be installed again"
grep -q '^# ours' "$root/etc/tissueform/server.ini" || fail "the configuration was overwritten"
ok "installed again, the changed configuration stays"

inside apt-get remove -y -qq "${installed[@]}" >"$scratch/install.log" 2>&1 || fail "they cannot be removed"
[[ ! -e $root/usr/bin/tissueform-server && -e $root/etc/tissueform/server.ini && -e $root/var/lib/tissueform/tissueform.db ]] || fail "removed wrongly"
inside apt-get purge -y -qq "${installed[@]}" >"$scratch/install.log" 2>&1 || fail "they cannot be purged"
[[ ! -e $root/etc/tissueform && -e $root/var/lib/tissueform/tissueform.db ]] || fail "purged wrongly"
left=$(find "$root/etc" "$root/usr" "$root/lib/systemd" -name '*tissueform*' ! -path '*/python*' | head)
[[ -z $left ]] || fail "left behind: $left"
ok "removed and purged; what the server has kept stays"
