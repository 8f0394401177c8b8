//! How much memory this process has taken.

/// Largest resident size of this process in bytes so far; 0 where the system does not tell.
#[must_use]
pub fn peak_rss_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    peak_of(&status).unwrap_or(0)
}

/// The line `VmHWM:   1234 kB` of proc(5).
fn peak_of(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_read_where_there_is_one() {
        assert_eq!(peak_of("Name:\tx\nVmHWM:\t   1024 kB\nVmRSS: 1 kB\n"), Some(1 << 20));
        assert_eq!(peak_of("VmHWM: many"), None);
        assert_eq!(peak_of(""), None);
        if cfg!(target_os = "linux") {
            assert!(peak_rss_bytes() > 1 << 16);
        }
    }
}
