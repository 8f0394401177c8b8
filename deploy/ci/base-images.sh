#!/usr/bin/env bash
# Makes the Dockerfile's two base images on a machine that can pull none.
#
#   deploy/ci/base-images.sh      (as root; needs debootstrap, Docker and this machine's Rust)
#
# debian:bookworm-slim   a minimal Debian from Debian's own archive
# rust:1.95-bookworm     the same with a C compiler, this machine's Rust toolchain and the crates that
#                        Cargo.lock names, so that the build inside needs no network
#
# They carry the names of the published images, so that the very Dockerfile and compose file that a
# user runs are what is tested. An image of that name that this script did not make is left alone.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

readonly runtime_image=debian:bookworm-slim
readonly build_image=rust:1.95-bookworm
readonly label=equilux.local-base
readonly mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}

# The label's value names all that the image is made of: as long as it is the same, so is the image.
runtime_key=$(sha256sum deploy/ci/base-images.sh)
runtime_key=${runtime_key%% *}
build_key=$({ echo "$runtime_key"; rustc --version; cat Cargo.lock; } | sha256sum)
build_key=${build_key%% *}

# Whether image $1 has to be made: it is absent, or it is ours and its key is not $2.
must_make() {
    local found
    found=$(docker image inspect --format "{{with .Config.Labels}}{{index . \"$label\"}}{{end}}" \
        "$1" 2>/dev/null) || return 0
    [[ -n $found && $found != "$2" ]]
}

install_debian() {
    debootstrap --variant=minbase bookworm "$root" "$mirror" >"$work/debootstrap.log" 2>&1 \
        || { tail -n 20 "$work/debootstrap.log" >&2; return 1; }
    forget_downloads
}

forget_downloads() {
    rm -rf "$root"/var/cache/apt/*.bin "$root"/var/cache/apt/archives/*.deb "$root"/var/lib/apt/lists/*
}

install_rust() {
    local sysroot
    sysroot=$(rustc --print sysroot)
    cp /etc/resolv.conf "$root/etc/resolv.conf"
    chroot "$root" sh -c 'apt-get -q update && DEBIAN_FRONTEND=noninteractive \
        apt-get -q install -y --no-install-recommends gcc libc6-dev' >"$work/apt.log" 2>&1 </dev/null \
        || { tail -n 20 "$work/apt.log" >&2; return 1; }
    forget_downloads
    cp "$sysroot/bin/cargo" "$sysroot/bin/rustc" "$root/usr/local/bin/"
    cp -a "$sysroot/lib/." "$root/usr/local/lib/"
    install_crates
}

# All crates as directories that cargo takes in place of the registry.
install_crates() {
    mkdir -p "$root/usr/local/cargo"
    cargo vendor --locked --quiet --versioned-dirs "$root/usr/local/cargo/vendor" >/dev/null
    cat >"$root/usr/local/cargo/config.toml" <<'TOML'
[source.crates-io]
replace-with = "vendored"

[source.vendored]
directory = "/usr/local/cargo/vendor"

[net]
offline = true
TOML
}

# Imports the tree under the name $1 with the key $2; further arguments go to docker.
import() {
    local image=$1 key=$2
    shift 2
    rm -f "$root/etc/resolv.conf" "$root/etc/hostname"
    tar -C "$root" --one-file-system --exclude='./dev/*' --exclude='./proc/*' --exclude='./sys/*' -c . \
        | docker import --change "LABEL $label=$key" "$@" - "$image" >/dev/null
    echo "made $image"
}

main() {
    local make_runtime=no make_build=no
    if must_make "$runtime_image" "$runtime_key"; then make_runtime=yes; fi
    if must_make "$build_image" "$build_key"; then make_build=yes; fi
    if [[ $make_runtime$make_build == nono ]]; then
        echo "base images are up to date"
        return
    fi

    work=$(mktemp -d)
    root=$work/root
    trap 'rm -rf --one-file-system "$work"' EXIT
    install_debian
    if [[ $make_runtime == yes ]]; then
        import "$runtime_image" "$runtime_key" --change 'CMD ["bash"]'
    fi
    if [[ $make_build == yes ]]; then
        install_rust
        import "$build_image" "$build_key" --change 'ENV CARGO_HOME=/usr/local/cargo' \
            --change 'CMD ["bash"]'
    fi
}

main
