//! What stands at an axis: times in the unit that suits them, counts of workers in powers of two.

use std::ops::Range;

use crate::table::time;

/// Times from here on are written as clocks show them.
const CLOCK_FROM_S: f64 = 120.0;

/// The axis of times up to `most` seconds: what it says at a time.
pub(super) fn time_label(most: f64) -> impl Fn(&f64) -> String {
    let digits = digits(most);
    move |&seconds| {
        if most >= CLOCK_FROM_S { clock(seconds) } else { format!("{seconds:.digits$}") }
    }
}

/// The unit of [`time_label`], for the axis' name.
pub(super) const fn time_unit(most: f64) -> &'static str {
    if most >= CLOCK_FROM_S { "h:mm:ss" } else { "s" }
}

/// The range of an axis of counts of workers up to `most`, with room for the last one.
pub(super) fn workers(most: u32) -> Range<f64> {
    0.8..f64::from(most.max(2)) * 1.25
}

/// How many labels an axis of powers of two needs.
pub(super) fn powers(most: u32) -> usize {
    most.max(2).ilog2() as usize + 2
}

/// A count at an axis, if it is one: 4,096.
pub(super) fn count(value: &f64) -> String {
    if value.fract() != 0.0 {
        return String::new();
    }
    grouped(*value)
}

/// A number of bytes or messages, short: 1.5, 20, 3 k, 2 M.
pub(super) fn short(value: &f64) -> String {
    let (scaled, unit) = match *value {
        value if value >= 1e9 => (value / 1e9, " G"),
        value if value >= 1e6 => (value / 1e6, " M"),
        value if value >= 1e3 => (value / 1e3, " k"),
        value => (value, ""),
    };
    format!("{scaled}{unit}")
}

fn grouped(value: f64) -> String {
    let digits = format!("{value:.0}");
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

fn clock(seconds: f64) -> String {
    if seconds == 0.0 { "0".into() } else { time(seconds) }
}

/// Digits after the point that tell the marks of an axis apart.
fn digits(most: f64) -> usize {
    match most {
        most if most >= 10.0 => 0,
        most if most >= 1.0 => 1,
        most if most >= 0.1 => 2,
        _ => 3,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_labelled_in_units_that_suit() {
        assert_eq!(time_label(30.0)(&12.0), "12");
        assert_eq!(time_label(0.3)(&0.25), "0.25");
        assert_eq!(time_label(4000.0)(&3943.0), "1:05:43");
        assert_eq!(time_label(4000.0)(&0.0), "0");
        assert_eq!((count(&4096.0).as_str(), count(&0.5).as_str()), ("4,096", ""));
        assert_eq!([short(&0.1), short(&20.0), short(&2e6)], ["0.1", "20", "2 M"]);
    }
}
