//! Bytes of a foreign file as text, whatever a logger or a spreadsheet has saved them as.

/// The text without a byte order mark. What is neither UTF-16 with such a mark nor UTF-8 is read as Latin-1, in which `°` and `µ` are single
/// bytes: numbers are the same in all of them.
pub(crate) fn decoded(bytes: &[u8]) -> String {
    let wide = |bytes: &[u8], unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect();
        String::from_utf16_lossy(&units)
    };
    match bytes {
        [0xff, 0xfe, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => wide(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => narrow(rest),
        _ => narrow(bytes),
    }
}

fn narrow(bytes: &[u8]) -> String {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.to_string(),
        Err(_) => bytes.iter().map(|b| char::from(*b)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_and_old_encodings_are_seen_through() {
        assert_eq!(decoded(b"\xef\xbb\xbfx (\xc2\xb5m)"), "x (µm)");
        assert_eq!(decoded(b"x (\xb5m)"), "x (µm)");
        assert_eq!(decoded(b"\xff\xfex\0;\0"), "x;");
        assert_eq!(decoded(b"\xfe\xff\0x\0;"), "x;");
    }
}
