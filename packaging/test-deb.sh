#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages into a clean Debian, runs a job there, builds a stranger's plugin, removes
# everything again and looks for leftovers.
#   packaging/test-deb.sh [bookworm]   uses the packages of packaging/build-deb.sh
#   packaging/test-deb.sh trixie       builds, tests and packages from source inside that release first
# Needs root, debootstrap, and a mirror of the distribution in DEBIAN_MIRROR (default: the one that
# apt uses here).
set -euo pipefail
cd "$(dirname "$0")/.."
release=${1:-bookworm}
root=$PWD/build/debootstrap-$release
mirror=${DEBIAN_MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' | head -n 1)}

if ((EUID != 0)); then echo "test-deb: must run as root (chroot)" >&2; exit 1; fi
if ! command -v debootstrap >/dev/null; then echo "test-deb: install debootstrap" >&2; exit 1; fi

inside() { chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin \
  DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 "$@"; }
cleanup() { umount "$root/proc" 2>/dev/null || true; }
trap cleanup EXIT

cleanup
rm -rf "$root"
debootstrap --variant=minbase "$release" "$root" "$mirror"
mount -t proc proc "$root/proc"
cp /etc/apt/apt.conf.d/* "$root/etc/apt/apt.conf.d/" 2>/dev/null || true
inside apt-get update -qq

if [[ $release == bookworm ]]; then
  mkdir -p "$root/packages"
  cp build/deb/*.deb "$root/packages/"
else
  mkdir -p "$root/source"
  git ls-files -z | xargs -0 cp --parents -t "$root/source"
  inside apt-get install -y -qq --no-install-recommends build-essential debhelper devscripts equivs git \
    fakeroot lintian
  cp -r packaging/debian "$root/source/debian"
  inside bash -c 'cd /source && mk-build-deps --install --remove --tool "apt-get -y -qq" debian/control'
  inside bash -c 'cd /source && git init -q . && git add -A . >/dev/null && packaging/build-deb.sh --with-tests'
  mkdir -p "$root/packages"
  mv "$root"/source/build/deb/*.deb "$root/packages/"
fi

inside bash -c 'dpkg-query -W -f "\${Package}\n" | sort' >"$root/before.txt"
inside bash -c 'apt-get install -y -qq --no-install-recommends /packages/*.deb' >/dev/null
echo "test-deb: installed"
inside diorama --version
inside diorama plugins
inside diorama run /usr/share/diorama/configs/dining_room.yaml --output /tmp/dataset
inside bash -c 'test -s /tmp/dataset/dataset.json && find /tmp/dataset -name "rgb_*.png" | wc -l'
echo "test-deb: the default job ran"

inside apt-get install -y -qq --no-install-recommends cmake g++ make >/dev/null
inside bash -c 'cd /tmp && diorama new-plugin writer my_boxes && cmake -S my_boxes -B build >/dev/null &&
  cmake --build build >/dev/null && diorama plugins --plugin-dir build' | grep my_boxes
echo "test-deb: a stranger's plugin builds and is listed"

inside bash -c 'apt-get purge -y -qq $(dpkg-query -W -f "\${Package}\n" "*diorama*")' >/dev/null
left=$(inside find / -xdev \( -path /proc -o -path /tmp -o -path /packages -o -path /source -o -path /root \) \
  -prune -o -iname '*diorama*' -print)
if [[ -n $left ]]; then
  echo "test-deb: left behind after removal:" >&2
  echo "$left" >&2
  exit 1
fi
echo "test-deb: removed without leftovers"
