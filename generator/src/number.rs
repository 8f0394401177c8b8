//! Numbers as text, the same bytes on every machine: fixed point, no trailing zeros, no minus zero.

/// Decimals of a position: a tenth of a millimetre.
pub(crate) const POSITION_DECIMALS: u32 = 4;

/// Decimals of a normal's coordinates.
pub(crate) const NORMAL_DECIMALS: u32 = 3;

/// Appends `value`, rounded to `decimals`.
pub(crate) fn push_number(text: &mut String, value: f64, decimals: u32) {
    let scale = 10_i64.pow(decimals);
    let scaled = (value * scale as f64).round() as i64;
    if scaled < 0 {
        text.push('-');
    }
    let magnitude = scaled.unsigned_abs();
    let scale = scale.unsigned_abs();
    text.push_str(&(magnitude / scale).to_string());
    let fraction = magnitude % scale;
    if fraction > 0 {
        let digits = format!(".{fraction:0width$}", width = decimals as usize);
        text.push_str(digits.trim_end_matches('0'));
    }
}

/// Numbers with a space between.
pub(crate) fn numbers(values: &[f64], decimals: u32) -> String {
    let mut text = String::new();
    for (index, &value) in values.iter().enumerate() {
        if index > 0 {
            text.push(' ');
        }
        push_number(&mut text, value, decimals);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_exact() {
        assert_eq!(numbers(&[0.0, -0.00001, 1.25, -0.0625, 12.0], 4), "0 0 1.25 -0.0625 12");
        assert_eq!(numbers(&[0.9996, 0.05, -1.9999], 3), "1 0.05 -2");
    }
}
