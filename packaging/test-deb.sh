#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tries the packages as their users would: installs them into a clean Debian, runs the default job
# there, goes through the page for plugin authors from `apt install` to a dataset, runs the tests that
# come with the packages, removes everything and looks for leftovers.
#   packaging/test-deb.sh            Debian 12, with the packages of packaging/build-deb.sh
#   packaging/test-deb.sh trixie     Debian 13: first builds, tests and packs the source there
#   packaging/test-deb.sh RELEASE FOLDER   either, with packages of that release that were built before
# Needs root; installs debootstrap. Packages come from the mirror that apt uses here. The default job renders
# with fewer samples per pixel (SAMPLES, default 2): what is tried is the installation.
set -euo pipefail
cd "$(dirname "$0")/.."
release=${1:-bookworm}
packages=${2:-}
mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Label: Debian' | head -n 1)

if ((EUID != 0)); then echo "test-deb: must run as root (chroot)" >&2; exit 1; fi
if ! command -v debootstrap >/dev/null; then
  apt-get update -qq
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends debootstrap >/dev/null
fi
mkdir -p build
if [[ -z $packages && $release == bookworm ]]; then packages=build/deb; fi
if [[ $packages && ! -e $(echo "$packages"/diorama_*.deb) ]]; then
  echo "test-deb: no packages in $packages; run packaging/build-deb.sh" >&2
  exit 1
fi

say() { echo "test-deb: $*"; }
inside() { chroot "$root" /usr/bin/env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin \
  DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 TERM=dumb "$@"; }
install() { inside apt-get install -qq "$@" >/dev/null; }
unmount() {
  for place in "$PWD/build/debootstrap-$release"{,-build}/{proc,ccache}; do
    umount "$place" 2>/dev/null || true
  done
}
trap unmount EXIT

# make_system FOLDER: a clean Debian, which all that follows works in.
make_system() {
  root=$1
  unmount
  rm -rf "$root"
  debootstrap --variant=minbase "$release" "$root" "$mirror" >"build/debootstrap-$release.log"
  mount -t proc proc "$root/proc"
  # How apt reaches the mirror from here (proxies) holds inside, too; nobody is there to be asked.
  {
    apt-config dump | grep -E '^Acquire::(http|https|Check|Retries)' || true
    echo 'APT::Get::Assume-Yes "true"; APT::Install-Recommends "false";'
  } >"$root/etc/apt/apt.conf.d/90test"
  inside apt-get update -qq
  say "a clean Debian $(cat "$root/etc/debian_version") at $root"
}

# Builds, tests and packs the source inside; the packages end up in build/deb-RELEASE.
build_inside() {
  packaging/build-deb.sh --source >/dev/null
  mkdir "$root/source"
  cp build/deb/diorama_* "$root/source/"
  install build-essential fakeroot lintian
  inside apt-get build-dep -qq "/source/$(cd build/deb && ls ./*.dsc)" >/dev/null
  say "built with $(inside dpkg-query -W -f '${Package} ${Version}, ' g++ catch2 libembree-dev \
    libboost-dev libassimp-dev libbullet-dev libfmt-dev python3-opencv)"
  local cache=()
  if [[ ${CMAKE_CXX_COMPILER_LAUNCHER:-} == ccache ]]; then
    install ccache
    mkdir "$root/ccache"
    mount --bind "$CCACHE_DIR" "$root/ccache"
    cache=(CCACHE_DIR=/ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache)
  fi
  inside dpkg-source -x "/source/$(cd build/deb && ls ./*.dsc)" /source/tree >/dev/null
  inside env "${cache[@]}" "DEB_BUILD_OPTIONS=parallel=$(nproc)" \
    sh -c 'cd /source/tree && dpkg-buildpackage --no-sign --build=binary' >"build/deb-$release.log" 2>&1 ||
    { tail -n 100 "build/deb-$release.log" >&2; exit 1; }
  grep 'tests passed' "build/deb-$release.log"
  inside sh -c 'cd /source && lintian --fail-on error,warning ./*.changes'
  rm -rf "build/deb-$release"
  mkdir "build/deb-$release"
  cp "$root"/source/*.deb "build/deb-$release/"
  say "built, tested and packed inside $release"
}

run_default_job() {
  inside diorama --version
  inside diorama plugins
  inside diorama run /usr/share/diorama/configs/dining_room.yaml --output /tmp/dataset \
    --set "renderer.samples=${SAMPLES:-2}"
  inside diorama lint /tmp/dataset
  say "the default job ran: $(find "$root/tmp/dataset" -name 'rgb_*.png' | wc -l) pictures"
}

# The page begins with `apt install ./*.deb`.
go_through_page() {
  packaging/page_commands.sh sdk/docs/writing_a_plugin.md >"$root/packages/walk.sh"
  inside sh -c 'cd /packages && sh -eux walk.sh' >"build/walk-$release.log" 2>&1 ||
    { tail -n 100 "build/walk-$release.log" >&2; exit 1; }
  tail -n 6 "build/walk-$release.log"
  say "the commands of the page for plugin authors lead to a dataset"
}

run_package_tests() {
  local name
  install mesa-vulkan-drivers  # as tests/control says
  for name in smoke build-plugin; do
    inside sh -c "mkdir /tmp/$name && AUTOPKGTEST_TMP=/tmp/$name sh /packages/$name" \
      >"build/$name-$release.log" 2>&1 || { tail -n 100 "build/$name-$release.log" >&2; exit 1; }
    say "debian/tests/$name passed"
  done
}

files_inside() {
  inside find / -xdev \( -path /proc -o -path /tmp -o -path /root -o -path /packages -o -path /var/cache \
    -o -path /var/lib/apt -o -path /var/lib/dpkg -o -path /var/log \) -prune -o -printf '%y %p\n' | sort
}

# Tools that the page and the tests asked for go as well: apt installed them on our behalf, also where what
# stays would only like to have them (libc6 of Debian 13 recommends libidn2-0).
remove_everything() {
  inside sh -c 'apt-mark auto $(apt-mark showmanual) >/dev/null; apt-mark manual $(cat /root/before)' \
    >/dev/null
  inside sh -c 'apt-get purge -qq $(dpkg-query -W -f "\${Package}\n" "*diorama*")' >/dev/null
  inside apt-get autoremove --purge -qq -o APT::AutoRemove::RecommendsImportant=false \
    -o APT::AutoRemove::SuggestsImportant=false >/dev/null
}

if [[ -z $packages ]]; then
  make_system "$PWD/build/debootstrap-$release-build"
  build_inside
  packages=build/deb-$release
fi
make_system "$PWD/build/debootstrap-$release"
mkdir "$root/packages"
cp "$packages"/*.deb packaging/debian/tests/{smoke,build-plugin} "$root/packages/"
rm -f "$root"/packages/*-dbgsym_*.deb
inside sh -c 'apt-mark showmanual >/root/before'
files_inside >"build/before-$release.txt"

go_through_page
run_default_job
run_package_tests
remove_everything
files_inside >"build/after-$release.txt"
if ! diff "build/before-$release.txt" "build/after-$release.txt"; then
  say "left behind after removal (lines with >), or taken along (<)" >&2
  exit 1
fi
say "removed without leftovers"
