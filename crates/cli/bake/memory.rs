//! What memory there is for a bake.

/// Memory of the machine with what it can swap, or of the control group that the program runs in where that is less, bytes;
/// `None` where the system does not say.
pub fn of_this_machine() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let kib = |field: &str| -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(field))?;
        line.trim().strip_suffix("kB")?.trim().parse().ok()
    };
    let machine = (kib("MemTotal:")? + kib("SwapTotal:").unwrap_or(0)) * 1024;
    // "max" where there is no limit.
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max");
    let group = group.ok().and_then(|text| text.trim().parse().ok());
    Some(group.map_or(machine, |group: u64| group.min(machine)))
}
