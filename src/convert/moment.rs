//! Moments: numbers that count from somewhere, and dates with a time of day. Kept as whole numbers, so that nanoseconds since 1970 lose
//! nothing before the first of them is taken away.

/// A moment as a whole number of 10^-`decimals` of its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Moment {
    count: i128,
    decimals: u32,
}

/// More decimals than these are cut; what stands behind them is below any clock.
const MOST_DECIMALS: u32 = 15;

impl Moment {
    /// A plain decimal number, exactly.
    pub fn decimal(text: &str) -> Option<Moment> {
        let (negative, digits) = match text.strip_prefix('-') {
            Some(rest) => (true, rest),
            None => (false, text),
        };
        if digits.contains(['e', 'E']) {
            let value: f64 = text.parse().ok()?;
            return (value.abs() < 1e15)
                .then(|| Moment { count: (value * 1e12).round() as i128, decimals: 12 });
        }
        let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
        let part = part.get(..part.len().min(MOST_DECIMALS as usize))?;
        let all = format!("{whole}{part}");
        if all.is_empty() || all.len() > 34 || !all.bytes().all(|b| b.is_ascii_digit()) {
            return None;
        }
        let count: i128 = all.parse().ok()?;
        Some(Moment { count: if negative { -count } else { count }, decimals: part.len() as u32 })
    }

    /// This moment less another one, in their unit.
    pub fn since(self, zero: Moment) -> f64 {
        let decimals = self.decimals.max(zero.decimals);
        let count = |m: Moment| m.count.saturating_mul(10i128.pow(decimals - m.decimals));
        count(self).saturating_sub(count(zero)) as f64 / 10f64.powi(decimals as i32)
    }

    /// In its unit, rounded.
    pub fn value(self) -> f64 {
        self.count as f64 / 10f64.powi(self.decimals as i32)
    }
}

/// A date with a time of day in the form of ISO 8601 (`2024-03-05T12:30:01.25Z`, a blank for the `T`), or a time of day alone, in s. Offsets
/// from UTC are taken into account.
pub(super) fn read(text: &str) -> Option<Moment> {
    let text = text.trim();
    let (date, time) = match text.split_once(['T', ' ']) {
        Some((date, time)) => (days(date)?, time.trim()),
        None if text.contains(':') => (0, text),
        None => return None,
    };
    let (clock, offset) = match time.find(['Z', '+', '-']) {
        Some(at) => (&time[..at], zone(&time[at..])?),
        None => (time, 0),
    };
    let mut parts = clock.trim().splitn(3, ':');
    let (hours, minutes) = (digits(parts.next()?)?, digits(parts.next()?)?);
    let seconds = parts.next().unwrap_or("0").replace(',', ".");
    let seconds = Moment::decimal(&seconds).filter(|s| s.count >= 0)?;
    if hours > 24 || minutes > 59 || seconds.value() >= 61.0 {
        return None;
    }
    let whole = i128::from(date) * 86_400 + i128::from(hours * 3600 + minutes * 60 - offset);
    let decimals = seconds.decimals;
    Some(Moment { count: whole * 10i128.pow(decimals) + seconds.count, decimals })
}

fn digits(text: &str) -> Option<i64> {
    let plain = !text.is_empty() && text.len() <= 4 && text.bytes().all(|b| b.is_ascii_digit());
    plain.then(|| text.parse().ok())?
}

/// Days since 1970 of `YYYY-MM-DD`.
fn days(text: &str) -> Option<i64> {
    let mut parts = text.split(['-', '/']);
    let (year, month, day) = (parts.next()?, digits(parts.next()?)?, digits(parts.next()?)?);
    if year.len() != 4 || parts.next().is_some() || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let year = digits(year)?;
    // Years begin in March here, so that a leap day is the last of its year.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let leaps = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    Some(365 * year + leaps + (153 * month + 2) / 5 + day - 1 - 719_468)
}

/// Seconds east of UTC of `Z`, `+01:00`, `-0530`.
fn zone(text: &str) -> Option<i64> {
    if text == "Z" {
        return Some(0);
    }
    let sign = if text.starts_with('-') { -1 } else { 1 };
    let plain = text.get(1..)?.replace(':', "");
    let (hours, minutes) = match plain.len() {
        2 => (digits(&plain)?, 0),
        4 => (digits(plain.get(..2)?)?, digits(plain.get(2..)?)?),
        _ => return None,
    };
    Some(sign * (3600 * hours + 60 * minutes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_count_from_1970() {
        let s = |text| read(text).map(Moment::value);
        assert_eq!(s("1970-01-01T00:00:00Z"), Some(0.0));
        assert_eq!(s("2024-03-05T05:15:52+01:00"), Some(1_709_612_152.0));
        assert_eq!(s("2000-02-29 12:00:00.25"), Some(951_825_600.25));
        assert_eq!(s("12:30"), Some(45_000.0));
        for text in
            ["2024-13-01T00:00", "24-01-01 10:00", "2024-01-01", "12", "a:b", "10:75", "", "T:", "é:é"]
        {
            assert_eq!(read(text), None, "{text}");
        }
    }

    #[test]
    fn nanoseconds_since_1970_keep_their_last_digit() {
        let m = |text| Moment::decimal(text).expect("a number");
        assert_eq!(m("1709644368666655501").since(m("1709644368666655500")), 1.0);
        assert_eq!(m("1709644375.9348714").since(m("1709644368.6666555")), 7.2682159);
        assert_eq!(m("-1.5").value(), -1.5);
        assert_eq!(Moment::decimal("."), None);
    }
}
