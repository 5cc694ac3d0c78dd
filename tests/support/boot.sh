#!/bin/sh
# Boots systemd as the first process of namespaces of its own, on an overlay of this machine's
# files: nothing is installed here, and all of it goes with its last process. Run by `unshare`, as
# root.
#
# boot.sh WORK TARGET: WORK has the empty folders disk and root; what lies in WORK/files is laid
# over this machine's files, or over those of another system's root where the link WORK/lower leads
# to one.
set -eu
work=$1
target=$2

mount --make-rprivate /
mount -t tmpfs -o size=1000M tmpfs "$work/disk"
mkdir "$work/disk/upper" "$work/disk/work"
root=$work/root
lower=/
[ ! -e "$work/lower" ] || lower=$(realpath "$work/lower")
mount -t overlay -o "lowerdir=$lower,upperdir=$work/disk/upper,workdir=$work/disk/work" overlay "$root"
cp -a "$work/files/." "$root/"
# A disk of its own for what must survive a power cut.
if [ -e "$work/kept" ]; then
    mkdir -p "$root/var/lib/randt"
    mount -o loop "$(realpath "$work/kept")" "$root/var/lib/randt"
fi
# Units are started, whatever the policy of this machine's packages is.
rm -f "$root/usr/sbin/policy-rc.d"

mount -t proc proc "$root/proc"
mount -t tmpfs -o mode=755 tmpfs "$root/dev"
for device in null zero full random urandom tty; do
    touch "$root/dev/$device"
    mount --bind "/dev/$device" "$root/dev/$device"
done
mkdir "$root/dev/pts" "$root/dev/shm"
mount -t devpts -o newinstance,ptmxmode=0666,mode=620,gid=5 devpts "$root/dev/pts"
ln -s pts/ptmx "$root/dev/ptmx"
ln -s /proc/self/fd "$root/dev/fd"
mount -t tmpfs -o mode=1777 tmpfs "$root/dev/shm"
mount -t tmpfs -o mode=755 tmpfs "$root/run"
mount -t tmpfs -o mode=1777 tmpfs "$root/tmp"
mount -t sysfs -o ro sysfs "$root/sys"
mount -t cgroup2 cgroup2 "$root/sys/fs/cgroup"

# What needs hardware, or a person.
for unit in systemd-sysctl systemd-modules-load systemd-udevd systemd-udev-trigger systemd-logind systemd-networkd \
    systemd-resolved systemd-timesyncd systemd-firstboot systemd-repart systemd-random-seed systemd-binfmt \
    systemd-tmpfiles-setup-dev systemd-remount-fs kmod-static-nodes console-getty; do
    ln -sf /dev/null "$root/etc/systemd/system/$unit.service"
done
for unit in systemd-udevd-kernel.socket systemd-udevd-control.socket getty.target dev-hugepages.mount \
    dev-mqueue.mount sys-fs-fuse-connections.mount sys-kernel-config.mount sys-kernel-debug.mount \
    sys-kernel-tracing.mount proc-sys-fs-binfmt_misc.automount; do
    ln -sf /dev/null "$root/etc/systemd/system/$unit"
done

cd "$root"
mkdir -p .old
pivot_root . .old
umount -l /.old
# LoadCredential needs mounts that propagate.
mount --make-rshared /
exec env -i container=randt-test PATH=/usr/sbin:/usr/bin:/sbin:/bin \
    /lib/systemd/systemd --system --log-target=journal --show-status=no --unit="$target" </dev/null >/dev/null 2>&1
