//! What a line gives away of the dialect that it is written in.

use super::block::Block;
use super::dialect::Dialect;
use super::token::Kind;

impl Dialect {
    /// What one line, bytes without its line end, says of the program's dialect; `None` where it could stand in any.
    pub fn of_line(line: &[u8]) -> Option<Dialect> {
        let line = line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(line).trim_ascii();
        let upper = line.to_ascii_uppercase();
        if upper.starts_with(b"%_N_") || upper.starts_with(b";$PATH") {
            return Some(Dialect::Siemens);
        }
        if upper.starts_with(b"%") {
            return (upper.len() > 1 && upper.ends_with(b"*")).then_some(Dialect::Heidenhain);
        }
        let behind = upper.trim_ascii_start().iter().take_while(|b| b.is_ascii_digit()).count();
        let statement = upper[behind..].trim_ascii_start();
        let heidenhain: [&[u8]; 9] = [
            b"BEGIN PGM",
            b"END PGM",
            b"BLK FORM",
            b"TOOL CALL",
            b"TOOL DEF",
            b"CYCL DEF",
            b"CALL LBL",
            b"FUNCTION TCPM",
            b"L X",
        ];
        if heidenhain.iter().any(|s| statement.starts_with(s))
            || (behind > 0 && [&b"L "[..], b"LBL "].iter().any(|s| statement.starts_with(s)))
        {
            return Some(Dialect::Heidenhain);
        }
        let block = Block::new(0, &upper, Dialect::Siemens);
        let siemens = block.tokens().iter().any(|token| match token.kind {
            Kind::Name | Kind::Call => {
                let name = block.name(token);
                let digits = name.trim_start_matches("CYCLE");
                let cycle = digits.len() < name.len() && digits.bytes().all(|b| b.is_ascii_digit());
                cycle
                    || matches!(
                        name.as_str(),
                        "DEF" | "PROC" | "TRAORI" | "TRAFOOF" | "SUPA" | "MSG" | "WORKPIECE" | "EXTERN"
                    )
            }
            Kind::Word(index) => {
                let word = &block.words()[index];
                let between = &upper[token.span.start + word.address.len()..word.span.end];
                between.trim_ascii_start().starts_with(b"=")
                    || matches!(word.number(), Some(v) if word.address == "G" && (v == 700.0 || v == 710.0 || v == 500.0))
            }
            _ => false,
        });
        siemens.then_some(Dialect::Siemens)
    }
}
