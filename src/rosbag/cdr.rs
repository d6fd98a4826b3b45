//! The binary form of messages: CDR, the Common Data Representation of DDS.
//!
//! Four bytes say how the rest is written; then values follow one another, each aligned to its own size from behind these four.

/// Why bytes are no such message.
pub(super) type Wrong = String;

/// Bytes that stand before the first value.
const HEAD: usize = 4;

/// Reads values one after the other.
pub(super) struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
    /// Values of eight bytes are aligned to eight of them, or to four in the second version.
    widest: usize,
}

impl<'a> Cdr<'a> {
    pub fn new(message: &'a [u8]) -> Result<Cdr<'a>, Wrong> {
        let Some((head, bytes)) = message.split_at_checked(HEAD) else {
            return Err(format!(
                "it has {} bytes, fewer than the four that say how it is written",
                message.len()
            ));
        };
        let (big_endian, widest) = match head[..2] {
            [0, 0] => (true, 8),
            [0, 1] => (false, 8),
            [0, 6] => (true, 4),
            [0, 7] => (false, 4),
            _ => {
                let what = "which is neither plain CDR (00 00, 00 01) nor plain CDR of the second version (00 06, 00 07)";
                return Err(format!("it begins with the bytes {:02x} {:02x}, {what}", head[0], head[1]));
            }
        };
        Ok(Cdr { bytes, at: 0, big_endian, widest })
    }

    /// The next `N` bytes, the least significant first.
    fn number<const N: usize>(&mut self) -> Result<[u8; N], Wrong> {
        self.at = self.at.next_multiple_of(N.min(self.widest));
        let mut number: [u8; N] = self.take(N)?.try_into().unwrap_or([0; N]);
        if self.big_endian {
            number.reverse();
        }
        Ok(number)
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], Wrong> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let (own, _) = rest.split_at_checked(count).ok_or_else(|| {
            format!(
                "it ends after {} bytes, where {count} more are needed at byte {}",
                self.bytes.len() + HEAD,
                self.at + HEAD
            )
        })?;
        self.at += count;
        Ok(own)
    }

    pub fn i32(&mut self) -> Result<i32, Wrong> {
        Ok(i32::from_le_bytes(self.number()?))
    }

    pub fn u32(&mut self) -> Result<u32, Wrong> {
        Ok(u32::from_le_bytes(self.number()?))
    }

    pub fn f64(&mut self) -> Result<f64, Wrong> {
        Ok(f64::from_le_bytes(self.number()?))
    }

    pub fn f64s<const N: usize>(&mut self) -> Result<[f64; N], Wrong> {
        let mut all = [0.0; N];
        for x in &mut all {
            *x = self.f64()?;
        }
        Ok(all)
    }

    /// Length with the zero at the end, then the letters.
    pub fn text(&mut self) -> Result<&'a str, Wrong> {
        let length = self.u32()? as usize;
        let bytes = self.take(length)?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(bytes).map_err(|_| format!("a text before byte {} is no UTF-8", self.at + HEAD))
    }

    /// How many elements follow, each of which has at least so many bytes.
    pub fn count(&mut self, smallest: usize) -> Result<usize, Wrong> {
        let count = self.u32()? as usize;
        let rest = self.bytes.len() - self.at.min(self.bytes.len());
        if count.saturating_mul(smallest) > rest {
            return Err(format!(
                "a list before byte {} claims {count} elements, {rest} bytes are left",
                self.at + HEAD
            ));
        }
        Ok(count)
    }

    pub fn numbers(&mut self) -> Result<Vec<f64>, Wrong> {
        (0..self.count(8)?).map(|_| self.f64()).collect()
    }

    /// Writers fill up to four or eight bytes, and no more.
    pub fn end(&self) -> Result<(), Wrong> {
        match self.bytes.len().saturating_sub(self.at) {
            0..8 => Ok(()),
            rest => Err(format!("{rest} bytes are left behind its last value")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A text, two numbers of eight bytes, a number of four: both orders of bytes, both versions.
    #[test]
    fn values_are_found_wherever_alignment_puts_them() {
        let text = ([2, 0, 0, 0], [b'a', 0, 0, 0]);
        let numbers = (1u32, 1f64, 7i32);
        // Behind three numbers of four bytes the second version needs no filling.
        for (version, filling) in [(0, &[0; 4][..]), (6, &[])] {
            let (length, letters) = text;
            let (a, b, c) = numbers;
            let little = [[0, version + 1, 0, 0], length, letters, a.to_le_bytes()].concat();
            let little = [&little[..], filling, &b.to_le_bytes(), &c.to_le_bytes()].concat();
            let big = [[0, version, 0, 0], [0, 0, 0, 2], letters, a.to_be_bytes()].concat();
            let big = [&big[..], filling, &b.to_be_bytes(), &c.to_be_bytes()].concat();
            for message in [little, big] {
                let mut cdr = Cdr::new(&message).expect("CDR");
                assert_eq!((cdr.text(), cdr.u32(), cdr.f64(), cdr.i32()), (Ok("a"), Ok(a), Ok(b), Ok(c)));
                assert_eq!(cdr.end(), Ok(()));
            }
        }
        let mut aligned =
            Cdr::new(&[0, 1, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f]).expect("CDR");
        assert_eq!((aligned.u32(), aligned.f64()), (Ok(9), Ok(1.0)));
        let mut closer = Cdr::new(&[0, 7, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f]).expect("CDR");
        assert_eq!((closer.u32(), closer.f64()), (Ok(9), Ok(1.0)));
    }

    #[test]
    fn no_list_is_longer_than_the_bytes_that_hold_it() {
        let mut cdr = Cdr::new(&[0, 1, 0, 0, 255, 255, 255, 255, 0, 0, 0, 0]).expect("CDR");
        assert!(
            cdr.numbers().expect_err("too many").contains("claims 4294967295 elements, 4 bytes are left")
        );
        assert!(Cdr::new(&[0, 1]).is_err() && Cdr::new(&[0, 2, 0, 0]).is_err());
        let mut cut = Cdr::new(&[0, 1, 0, 0, 5, 0, 0, 0, b'a']).expect("CDR");
        assert!(cut.text().is_err());
    }
}
