#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# From a bare Debian 12 to pictures in one command:
#   ./bootstrap.sh demo     install what is needed, build, make the sample pack, run the default job
#   ./bootstrap.sh test     install what is needed, build, run every test
#   ./bootstrap.sh build    install what is needed, build
#   ./bootstrap.sh sanitize install what is needed, build with sanitizers and run what reads files of others and
#                           the renderer (address, undefined) and what has threads (thread)
#   ./bootstrap.sh sanitize-more the same for tests that take longer, and the program with every writer (thread)
#   ./bootstrap.sh packages install what is needed for all of these, tests/check_format.sh and tests/check_tidy.sh
# Options: --preset NAME   a preset of CMakePresets.json (default: release)
set -euo pipefail
cd "$(dirname "$0")"
export CMAKE_GENERATOR=Ninja  # also of the projects that tests build

build_packages=(
  g++ cmake ninja-build pkgconf git
  libboost-dev libboost-filesystem-dev libbullet-dev libfcl-dev libembree-dev libeigen3-dev libassimp-dev
  libavcodec-dev libavutil-dev liburdfdom-dev libconsole-bridge-dev
  libyaml-cpp-dev libcli11-dev libspdlog-dev libfmt-dev nlohmann-json3-dev
  libre2-dev libhdf5-dev liblz4-dev libdeflate-dev zlib1g-dev libpng-dev libjpeg-dev libopenexr-dev libtbb-dev
  libvulkan-dev glslang-tools spirv-tools
  pybind11-dev python3-dev python3-minimal python3-numpy
  libxxhash-dev nettle-dev libopencv-core-dev libopencv-imgproc-dev libopencv-calib3d-dev libopencv-imgcodecs-dev
)
test_packages=(
  catch2 binutils clang libclang-rt-14-dev clang-19 lld-19 libclang-rt-19-dev mesa-vulkan-drivers
  python3-h5py python3-jsonschema python3-opencv mypy
)

check_packages=(clang-format-14 clang-tidy-19 clang-16)  # clang-16: for tests of the headers
# Tests by what they are about, for the sanitizers: in every run of CI, and by night.
foreign_bytes=(config_test host_test images_test loader_usd_test)  # readers of datasets: the fuzzers
renderer=(renderer_embree_test)
by_night=(
  sdk_test output_test datasets_test lint_test writer_support_test pipeline_test physics_bullet_test
  replicator_test plugin_search_test framework_inspect_test loader_usd_expected loader_assimp_test
  renderer_support_test loader_urdf_test
)
threads=(host_test pipeline_test output_test)
mapfile -t writers < <(cd plugins && ls -d writer_*/ | sed '/^writer_support/d; s,/,,')

usage() { sed -n '3,11s/^# \{0,1\}//p' "$0"; }

# Installs the packages that dpkg does not list as installed; says which. sudo only when not root.
install_packages() {
  local missing=() package
  for package in "$@"; do
    if ! dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'install ok installed'; then
      missing+=("$package")
    fi
  done
  if ((${#missing[@]} == 0)); then return; fi
  if ! command -v apt-get >/dev/null; then
    echo "bootstrap: apt-get not found; install by hand: ${missing[*]}" >&2
    exit 1
  fi
  local as_root=()
  if ((EUID != 0)); then as_root=(sudo); fi
  echo "bootstrap: installing ${missing[*]}"
  "${as_root[@]}" apt-get update -qq
  DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends \
    "${missing[@]}" >/dev/null
}

# configure ON includes the tests, configure OFF leaves them out: they need more packages and as
# much time again.
configure() {
  cmake --preset "$preset" -D DIORAMA_BUILD_TESTS="$1" >"build-$preset.log" 2>&1 || {
    cat "build-$preset.log" >&2
    rm -f "build-$preset.log"
    exit 1
  }
  rm -f "build-$preset.log"
}

# sanitize_build PRESET TEST..., sanitize_test PRESET TEST...: builds or runs some tests only.
sanitize_build() {
  preset=$1
  shift
  configure ON
  cmake --build --preset "$preset" --target "$@"
}
sanitize_test() {
  local names
  names=$(IFS='|'; echo "${*:2}")
  ctest --preset "$1" -j "$(nproc)" -R "^($names)\$"
}

# The program itself, with every writer at once on many threads, two shards after each other.
run_all_writers() {
  preset=$1
  configure ON
  cmake --build --preset "$preset" --target diorama physics_bullet randomizers_core renderer_null "${writers[@]}"
  local jobs=(tests/end_to_end/all_writers.yaml tests/end_to_end/all_clip_writers.yaml)
  local program=build/$preset/bin/diorama output job shard type
  for type in $("$program" plugins | grep -oE '\b[A-Za-z0-9]+Writer\b' | sort -u); do
    grep -q "type: $type," "${jobs[@]}" || { echo "bootstrap: $type is in none of ${jobs[*]}" >&2; exit 1; }
  done
  for job in "${jobs[@]}"; do
    output=$(mktemp -d)
    for shard in 1/2 2/2; do
      "$program" run "$job" --output "$output" --threads 4 --shard "$shard"
    done
    rm -rf "$output"
  done
}

# The program has no place on the PATH yet; says what to type.
say_program() {
  cat <<END

The program is build/$preset/bin/diorama; it finds plugins and samples beside itself. To call it by name:
  export PATH="$PWD/build/$preset/bin:\$PATH"
END
}

command=${1:-help}
shift || true
preset=release
while (($#)); do
  case $1 in
    --preset) preset=${2:?bootstrap: --preset needs a name}; shift 2 ;;
    *) echo "bootstrap: unknown option '$1'" >&2; usage >&2; exit 2 ;;
  esac
done

case $command in
  build)
    install_packages "${build_packages[@]}"
    configure OFF
    cmake --build --preset "$preset"
    say_program
    ;;
  demo)
    install_packages "${build_packages[@]}"
    configure OFF
    cmake --build --preset "$preset"
    # A finished dataset is left as it is, an interrupted one is completed.
    "build/$preset/bin/diorama" run configs/dining_room.yaml --resume
    say_program
    ;;
  test)
    install_packages "${build_packages[@]}" "${test_packages[@]}"
    configure ON
    cmake --build --preset "$preset"
    # One more than there are processors: tests wait for each other, for locks and for the clock.
    ctest --preset "$preset" -j "$(($(nproc) + 1))"
    ;;
  sanitize)
    install_packages "${build_packages[@]}" "${test_packages[@]}"
    sanitize_build asan "${foreign_bytes[@]}" "${renderer[@]}"
    # The renderer's test alone keeps one processor busy for as long as the next build takes.
    sanitize_test asan "${foreign_bytes[@]}" "${renderer[@]}" >build/asan/tests.log 2>&1 &
    asan_tests=$!
    trap 'kill "$asan_tests" 2>/dev/null || true' EXIT
    sanitize_build tsan "${threads[@]}"
    sanitize_test tsan "${threads[@]}"
    asan_code=0
    wait "$asan_tests" || asan_code=$?
    cat build/asan/tests.log
    exit "$asan_code"
    ;;
  sanitize-more)
    install_packages "${build_packages[@]}" "${test_packages[@]}"
    sanitize_build asan "${by_night[@]}"
    sanitize_test asan "${by_night[@]}"
    run_all_writers tsan
    ;;
  packages) install_packages "${build_packages[@]}" "${test_packages[@]}" "${check_packages[@]}" ;;
  help | -h | --help) usage ;;
  *) echo "bootstrap: unknown command '$command'" >&2; usage >&2; exit 2 ;;
esac
