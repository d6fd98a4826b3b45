//! NC programs: byte for byte, tokens, modal state, real programs, bytes that are none.

use kincal::Error;
use kincal::nc::{
    Block, Coordinate, Dialect, How, Kind, LONGEST_LINE, MotionKind, NcFault, Program, State, Step, Value,
    Why,
};
use proptest::prelude::*;

mod state;

const DIALECTS: [Dialect; 3] = [Dialect::Rs274, Dialect::Siemens, Dialect::Heidenhain];
const FIVE: [&str; 5] = ["X", "Y", "Z", "B", "C"];

/// Tokens in short: `X1.5` is a word with a number, `X<...>` one with an expression, else a letter and the text.
fn shown(line: &str, dialect: Dialect) -> String {
    let block = Block::new(1, line.as_bytes(), dialect);
    let token = |t: &kincal::nc::Token| {
        let text = block.text(&t.span);
        match t.kind {
            Kind::BlockNumber => format!("n:{text}"),
            Kind::Skip => format!("skip:{text}"),
            Kind::Comment => format!("c:{text}"),
            Kind::Percent => format!("%:{text}"),
            Kind::Call => format!("call:{}", block.name(t)),
            Kind::Name => format!("name:{text}"),
            Kind::Other => format!("o:{text}"),
            Kind::Word(i) => {
                let word = &block.words()[i];
                let how = if word.how == How::Modal { String::new() } else { format!("{:?} ", word.how) };
                match word.value {
                    Value::Number(n) => format!("{how}{}={}", word.address, n.value),
                    Value::Expression => {
                        format!("{how}{}<{}>", word.address, block.text(&word.value_span))
                    }
                }
            }
        }
    };
    block.tokens().iter().map(token).collect::<Vec<_>>().join(" | ")
}

#[test]
fn tricky_lines_are_cut_as_the_controls_read_them() {
    use Dialect::*;
    let table: &[(Dialect, &str, &str)] = &[
        (Rs274, "N10 G1 X1.5Y-.5 F100\r\n", "n:N10 | G=1 | X=1.5 | Y=-0.5 | F=100"),
        (Rs274, "/3 n20 x 1.5 y+3.", "skip:/3 | n:n20 | X=1.5 | Y=3"),
        (Rs274, "g1(to X5)z-.009 ; Y3", "G=1 | c:(to X5) | Z=-0.009 | c:; Y3"),
        (Rs274, "(tool (D=10) X50) X1", "c:(tool (D=10) X50) | X=1"),
        (Rs274, "(open X1", "c:(open X1"),
        (Rs274, "%O1234 X1", "%:%O1234 X1"),
        (Rs274, "X[#1+2*[3]] Y#5Z#<_a b>", "X<[#1+2*[3]]> | Y<#5> | Z<#<_a b>>"),
        (Rs274, "XSIN[30]YATAN[1]/[2] Z-#3", "X<SIN[30]> | Y<ATAN[1]/[2]> | Z<-#3>"),
        (Rs274, "#100=[#1+X] (c)", "o:#100=[#1+X] | c:(c)"),
        (Rs274, "#<x1>=5 X1", "o:#<x1>=5 | X=1"),
        (Rs274, "IF[#1 EQ 2]GOTO 10 (X1)", "name:IF | o:[#1 EQ 2]GOTO 10 | c:(X1)"),
        (Rs274, "WHILE [#1 LT X3] DO1", "name:WHILE | o:[#1 LT X3] DO1"),
        (Rs274, "o100 call [1] X2", "O=100 | name:call | o:[1] X2"),
        (Rs274, "M98 P1000", "M=98 | P=1000"),
        (Rs274, "G1 X10.,C2. Y5", "G=1 | X=10 | o:,C2. | Y=5"),
        (Rs274, "X1.5.2 Y1-2 Z1", "X<1.5.2> | Y<1-2> | Z=1"),
        (Rs274, "G54.1 P3 X", "G=54.1 | P=3 | name:X"),
        (Siemens, "N90 CYCLE800(1,\"X1)\",C3) X2", "n:N90 | call:CYCLE800 | X=2"),
        (Siemens, "MSG (\"X1)\") Y2", "call:MSG | Y=2"),
        (Siemens, "SUPA G0 X=_X_HOME Y=R1*2 Z=-_A", "name:SUPA | G=0 | X<_X_HOME> | Y<R1*2> | Z<-_A>"),
        (
            Siemens,
            "X=AC(10) Y=IC( -5. ) C=DC(90) B=ACP(R1)",
            "Absolute X=10 | Incremental Y=-5 | Shortest C=90 | Positive B<ACP(R1)>",
        ),
        (Siemens, "C1=90 X = 1.5 Y=2+3 Z=1.5EX3", "C1=90 | X=1.5 | Y<2+3> | Z<1.5EX3>"),
        (Siemens, "_X_HOME=-365. _Y_HOME=224.", "_X_HOME=-365 | _Y_HOME=224"),
        (Siemens, "DEF REAL X1, Y2=3 ;c", "name:DEF | o:REAL X1, Y2=3 | c:;c"),
        (Siemens, "T=\"D50 X3\" M6", "T<\"D50 X3\"> | M=6"),
        (Siemens, "N5 LABEL_1: G1 X=(R1+2)*3 Y1", "n:N5 | o:LABEL_1: | G=1 | X<(R1+2)*3> | Y=1"),
        (Siemens, "IF R1==5 GOTOF X10", "name:IF | o:R1==5 GOTOF X10"),
        (Siemens, "$P_UIFR[1,X,TR]=5 POS[X]=10 R1=3", "o:$P_UIFR[1,X,TR]=5 | o:POS[X]=10 | R1=3"),
        (Siemens, "MCALL CYCLE81(1,2) ;X", "name:MCALL | o:CYCLE81(1,2) | c:;X"),
        (Siemens, "CALL \"X1\" X2", "name:CALL | o:\"X1\" X2"),
        (Siemens, "L123 P2", "L=123 | P=2"),
        (Siemens, "G1 X=R1 (note)", "G=1 | X<R1> | c:(note)"),
        (
            Heidenhain,
            "12 L X+1,5 Y-Q1 IC+90 R0 FMAX M3",
            "n:12 | name:L | X=1.5 | Y<-Q1> | Incremental C=90 | R=0 | name:FMAX | M=3",
        ),
        (Heidenhain, "13 C X+5 Y+5 DR- ; X", "n:13 | name:C | X=5 | Y=5 | name:DR- | c:; X"),
        (Heidenhain, "14 L C+90 A-.5", "n:14 | name:L | C=90 | A=-0.5"),
        (Heidenhain, "15 TOOL CALL 5 Z S3000", "n:15 | name:TOOL | o:CALL 5 Z S3000"),
        (Heidenhain, "16 * - Bore X1", "n:16 | c:* - Bore X1"),
        (Heidenhain, "17 LN X+1 NX-.5 TZ+1", "n:17 | name:LN | X=1 | NX=-0.5 | TZ=1"),
        (Heidenhain, "/ 18 LP PA+30 PR+Q1 IPA-3", "skip:/ | n:18 | name:LP | PA=30 | PR<+Q1> | IPA=-3"),
        (Heidenhain, "0 BEGIN PGM X1 MM", "n:0 | name:BEGIN | o:PGM X1 MM"),
        (Heidenhain, "N10 G01 X+10 Y-5*", "n:N10 | G=1 | X=10 | Y=-5 | o:*"),
    ];
    for (dialect, line, expected) in table {
        let found = shown(line, *dialect);
        assert_eq!(found, *expected, "{dialect:?} {line:?}");
    }
}

#[test]
fn dialects_are_taken_from_the_first_blocks() {
    let of = |text: &str| Program::new("p", text.as_bytes()).expect("readable").dialect();
    assert_eq!(of("%\nO1000 (x)\nG90 G54\nX1. Y2.\nG43.4 H1\nM30\n%\n"), Dialect::Rs274);
    assert_eq!(of("%_N_PART_MPF\n;$PATH=/_N_WKS_DIR\n"), Dialect::Siemens);
    assert_eq!(of("N10 ;Start\nN20 G0 X1\nN30 TRAORI\n"), Dialect::Siemens);
    assert_eq!(of("N10 DEF REAL _A\n"), Dialect::Siemens);
    assert_eq!(of("\u{feff}0 BEGIN PGM TEST MM\r\n1 BLK FORM 0.1 Z\r\n"), Dialect::Heidenhain);
    assert_eq!(of("%NEW G71 *\nN10 G00*\n"), Dialect::Heidenhain);
    assert_eq!(of(""), Dialect::Rs274);
    let mut program = Program::with_dialect("p", &b"X1"[..], Dialect::Siemens);
    assert_eq!(program.dialect(), Dialect::Siemens);
    assert_eq!(program.next_block().expect("readable").expect("a block").line(), 1);
}

/// The program as it is written back, each number written as its own style would.
fn rewritten(bytes: &[u8], dialect: Option<Dialect>, touch: bool) -> Vec<u8> {
    let mut program = Program::new("p.nc", bytes).expect("readable");
    if let Some(dialect) = dialect {
        program.set_dialect(dialect);
    }
    let mut out = Vec::new();
    while let Some(mut block) = program.next_block().expect("short lines") {
        if touch {
            for i in 0..block.words().len() {
                if let Some(value) = block.words()[i].number() {
                    let text = block.words()[i].write_like(value, None);
                    block.replace(i, &text).expect("a number");
                }
            }
        }
        block.write_to(&mut out).expect("memory");
    }
    out
}

fn realistic() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        "[NGXYZABCFMTH][-+]?[0-9]{1,4}\\.?[0-9]{0,4}",
        "[XYZC]=[-+]?[0-9]{0,3}\\.[0-9]{1,4}",
        "[xyz] ?-?\\.[0-9]{1,3}",
        "C1=(AC|IC|DC|ACN)\\([0-9.+-]{0,5}\\)",
        "\\([ -~]{0,12}\\)?",
        ";[ -~]{0,12}",
        "X\\[[#0-9+*\\[\\]]{0,8}\\]?",
        "(IF|WHILE|DEF|GOTO|TRAORI|CYCLE800|MSG|TRANS|L|CC|TOOL CALL|IX|DR|FUNCTION) ?[(\"X0-9+-]{0,5}[)\"]?",
        "[ \t/%#=<>*,+-]{1,3}",
        "[#QR][0-9]{1,3}( ?= ?[+-]?[0-9]{1,3})?",
    ];
    let ends = prop_oneof![Just("\n"), Just("\r\n"), Just(""), Just("\r"), Just("\n\n")];
    let line = (proptest::collection::vec(piece, 0..8), prop_oneof![Just(""), Just(" ")], ends)
        .prop_map(|(pieces, glue, end)| pieces.join(glue) + end);
    proptest::collection::vec(line, 0..12).prop_map(|lines| lines.concat().into_bytes())
}

fn noise() -> impl Strategy<Value = Vec<u8>> {
    let odd: Vec<u8> = b"GXYZNABCIQ0123459.-+=/()[]#\"';:%*, \t\r\n_$E\xef\xbb\xbf\xff\0".to_vec();
    prop_oneof![
        proptest::collection::vec(any::<u8>(), 0..400),
        proptest::collection::vec(proptest::sample::select(odd), 0..200),
    ]
}

/// All that must hold of any bytes.
fn holds(bytes: &[u8]) {
    assert_eq!(rewritten(bytes, None, false), bytes);
    for dialect in DIALECTS {
        assert_eq!(rewritten(bytes, Some(dialect), false), bytes);
        let mut state = State::new(dialect, ["X", "Y", "Z", "A", "C", "C1"]);
        let mut program = Program::with_dialect("p", bytes, dialect);
        while let Some(block) = program.next_block().expect("short lines") {
            let line = block.bytes();
            let mut at = if line.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
            for token in block.tokens() {
                assert!(token.span.start >= at && token.span.end > token.span.start, "{token:?}");
                let blank = |b: &u8| b.is_ascii_whitespace() || *b == 0x0b;
                assert!(line[at..token.span.start].iter().all(blank), "{token:?} {line:?}");
                at = token.span.end;
                if let Kind::Word(i) = token.kind {
                    let word = &block.words()[i];
                    assert_eq!(word.span, token.span);
                    assert!(word.span.start <= word.value_span.start && word.value_span.end <= word.span.end);
                    let read = kincal::nc::Number::parse(&line[word.value_span.clone()], dialect);
                    assert_eq!(read.map(|n| n.value), word.number());
                }
            }
            assert!(line[at..].iter().all(|b| b.is_ascii_whitespace() || *b == 0x0b));
            if let Ok(Step { motion: Some(motion), .. }) = state.apply(&block) {
                assert_eq!(motion.line, block.line());
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_written_back_byte_for_byte(bytes in noise()) {
        holds(&bytes);
    }

    #[test]
    fn realistic_programs_are_written_back_byte_for_byte(bytes in realistic()) {
        holds(&bytes);
    }

    #[test]
    fn a_number_written_in_its_own_style_is_itself(text in "[+]?(0{0,2}[1-9][0-9]{0,5}|0|00|)(\\.[0-9]{0,6})?", minus: bool) {
        let text = if minus && !text.starts_with('+') { format!("-{text}") } else { text };
        let number = kincal::nc::Number::parse(text.as_bytes(), Dialect::Rs274);
        prop_assert_eq!(number.is_some(), text.bytes().any(|b| b.is_ascii_digit()));
        if let Some(number) = number {
            let zero = number.value == 0.0;
            let expected = if zero { text.replace('-', "") } else { text.clone() };
            prop_assert_eq!(number.write_like(number.value, None), expected.clone());
            prop_assert_eq!(number.write_like(number.value, Some(7)), expected);
        }
    }

    #[test]
    fn a_replaced_number_leaves_every_other_byte(
        before in "[ -~]{0,10}", value in -999.0..999.0f64, decimals in 0usize..6,
    ) {
        let line = format!("N1 G1 Y2. X12.50Z=3 ({before}\r\n");
        let mut block = Block::new(1, line.as_bytes(), Dialect::Rs274);
        let x = block.words().iter().position(|w| w.address == "X").expect("X");
        let text = block.words()[x].write_like(value, Some(decimals));
        block.replace(x, "7").expect("a number");
        block.replace(x, &text).expect("a number");
        prop_assert_eq!(String::from_utf8(block.output()).expect("text"), line.replace("12.50", &text));
        prop_assert!(!text.contains('e') && !text.starts_with("-0.00") || value.abs() >= 5e-7);
        let read: f64 = text.parse().expect("a number");
        prop_assert!((read - value).abs() <= 0.5000001 * 10f64.powi(-(decimals.max(2) as i32)));
    }
}

#[test]
fn numbers_are_written_in_the_style_of_the_source() {
    let table = [
        ("X.5", -0.25, None, "-.2"),
        ("X0.5", 0.25, Some(3), "0.25"),
        ("X-.009", 0.0123, Some(4), ".0123"),
        ("X-.009", -0.00001, Some(4), ".000"),
        ("X3.", 2.0004, Some(3), "2."),
        ("X3.", 2.0006, Some(3), "2.001"),
        ("X3", 2.0, Some(3), "2"),
        ("X3", 2.25, Some(3), "2.25"),
        ("X+3.0", 1.0, None, "+1.0"),
        ("X=+3.0", -1.0, None, "-1.0"),
        ("X007.5", 8.25, None, "008.2"),
        ("X1.", 1e20, None, "100000000000000000000."),
        ("X=AC( 1.50 )", 2.5, None, "2.50"),
    ];
    for (source, value, decimals, expected) in table {
        let mut block = Block::new(1, source.as_bytes(), Dialect::Siemens);
        let text = block.words()[0].write_like(value, decimals);
        assert_eq!(text, expected, "{source}");
        block.replace(0, &text).expect("a number");
        let span = block.words()[0].value_span.clone();
        let whole = format!("{}{expected}{}", &source[..span.start], &source[span.end..]);
        assert_eq!(String::from_utf8_lossy(&block.output()), whole);
    }
    let block = Block::new(1, b"L X-1,5", Dialect::Heidenhain);
    assert_eq!(block.words()[0].write_like(2.0, None), "+2,0");
}

#[test]
fn words_are_inserted_in_the_manner_of_the_block() {
    let inserted = |line: &str, address: &str| {
        let mut block = Block::new(1, line.as_bytes(), Dialect::Siemens);
        let after = block.words().iter().position(|w| w.address == "X").expect("X");
        block.insert(after, address, "2.5").expect("fits");
        block.replace(after, "1.5").expect("a number");
        String::from_utf8(block.output()).expect("text")
    };
    assert_eq!(inserted("N1 G1 X1. F5 ;c\n", "Y"), "N1 G1 X1.5 Y2.5 F5 ;c\n");
    assert_eq!(inserted("G1X1.F5", "Y"), "G1X1.5Y2.5F5");
    assert_eq!(inserted("X=AC(1)", "C1"), "X=AC(1.5) C1=2.5");
}

#[test]
fn faults_tell_line_column_and_mend() {
    let place = |e: &Error| e.place().map(|p| (p.line, p.column)).expect("a place");
    let mut block = Block::new(7, b"\xff X=R1 Y2", Dialect::Siemens);
    for (result, at) in [
        (block.replace(0, "1"), (7, 5)),
        (block.replace(5, "1"), (7, 1)),
        (block.replace(1, "1e5"), (7, 9)),
        (block.replace(1, "NaN"), (7, 9)),
        (block.insert(1, "1X", "1"), (7, 10)),
        (block.insert(1, "X", "-"), (7, 10)),
    ] {
        let error = result.expect_err("a fault");
        assert_eq!(place(&error), at, "{error}");
        assert!(!error.mend().is_empty() && !error.to_string().is_empty());
    }
    assert!(!block.is_changed());
    let mut state = State::new(Dialect::Rs274, FIVE);
    let error = state.apply(&Block::new(3, b"G1 X1 Y2 X3", Dialect::Rs274)).expect_err("twice");
    assert_eq!(
        (place(&error), error.to_string().as_str()),
        ((3, 10), ":3:10: `X` stands twice in this block, first in column 4")
    );
    assert_eq!(state.modes().motion, None);
}

#[test]
fn a_line_without_end_is_refused_with_its_number() {
    for before in [1usize, 500] {
        let mut bytes = "X1\n".repeat(before).into_bytes();
        bytes.extend(std::iter::repeat_n(b'X', LONGEST_LINE + 1));
        let mut program = Program::new("long.nc", &bytes[..]).expect("opens");
        let last = program.by_ref().last().expect("blocks");
        let error = last.expect_err("too long");
        assert_eq!(error.place().map(|p| p.line), Some(before + 1));
        assert_eq!(error.fault(), Some(&NcFault::LineTooLong { limit: LONGEST_LINE }));
        assert!(program.next().is_none());
    }
    let just = "(".repeat(LONGEST_LINE - 1) + "\n";
    holds_once(just.as_bytes());
    holds_once("(()".repeat(LONGEST_LINE / 3).as_bytes());
    holds_once("X1[(".repeat(LONGEST_LINE / 4).as_bytes());
    holds_once(format!("X{}.{}", "9".repeat(1000), "1".repeat(100_000)).as_bytes());
}

fn holds_once(bytes: &[u8]) {
    assert_eq!(rewritten(bytes, None, true).len(), bytes.len());
}
