//! What is done to a text: spans cut out, doubled, moved, numbers made extreme, words of the language and of other texts put in.

use rand::RngExt;
use rand::rngs::StdRng;

/// Numbers at the ends of what a reader can meet.
const NUMBERS: [&str; 24] = [
    "0",
    "-0",
    "1",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "NaN",
    "inf",
    "-inf",
    "0x10",
    "1_000",
    "9007199254740993",
    "99999999999999999999999999",
    "1e-9",
    "0.1.2",
    "1,5",
    "+",
    "-",
    ".",
    "4294967296",
    "-2147483649",
    "1e5",
];

/// Most that a span is long, bytes. Longer ones would leave little of a text.
const SPAN: usize = 40;
/// Most times that a span is repeated: deep enough for a stack that grows with nesting.
const REPEATS: usize = 2000;
/// A text grows no further: what is slow because it is long is no finding.
const LONGEST: usize = 1 << 16;

/// Damages `text` in one to four places; `donor` is another text of its kind, `words` what its language has.
pub fn mutate(random: &mut StdRng, text: &mut Vec<u8>, donor: &[u8], words: &[&str]) {
    // Half of all cases have one mutation: what is damaged in many places is refused at the first.
    let times = [1, 1, 1, 2, 3, 4][random.random_range(0..6)];
    for _ in 0..times {
        once(random, text, donor, words);
        text.truncate(LONGEST);
    }
}

fn once(random: &mut StdRng, text: &mut Vec<u8>, donor: &[u8], words: &[&str]) {
    let (from, to) = span(random, text);
    match random.random_range(0..13) {
        0 => drop(text.drain(from..to)),
        1 => {
            let doubled = text[from..to].to_vec();
            insert(text, from, &doubled);
        }
        2 => {
            let moved: Vec<u8> = text.drain(from..to).collect();
            let (at, _) = span(random, text);
            insert(text, at, &moved);
        }
        3 => text.truncate(from),
        4 => {
            let bytes: Vec<u8> =
                (0..random.random_range(1..5)).map(|_| random.random_range(0..=255)).collect();
            drop(text.splice(from..to, bytes));
        }
        5 | 6 => put(random, text, from, words),
        7..=9 => number(random, text),
        10 => {
            let (from_donor, to_donor) = span(random, donor);
            drop(text.splice(from..to, donor[from_donor..to_donor].iter().copied()));
        }
        11 => {
            let line = |bytes: &[u8], at: usize| {
                let start = bytes[..at].iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
                let end = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |i| at + i + 1);
                bytes[start..end].to_vec()
            };
            let (at, _) = span(random, donor);
            let start = text[..from].iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
            insert(text, start, &line(donor, at));
        }
        _ => {
            let many = if random.random_range(0..8) == 0 { REPEATS } else { 4 };
            let short = &text[from..to.min(from + 8)];
            let repeated = short.repeat(random.random_range(2..=many));
            insert(text, from, &repeated);
        }
    }
}

/// A word in the place of what stands there, or beside it.
fn put(random: &mut StdRng, text: &mut Vec<u8>, at: usize, words: &[&str]) {
    if words.is_empty() {
        return;
    }
    let word = words[random.random_range(0..words.len())].as_bytes();
    let over = if random.random_range(0..2) == 0 { word.len().min(text.len() - at) } else { 0 };
    drop(text.splice(at..at + over, word.iter().copied()));
}

/// Another number in the place of one of the text.
fn number(random: &mut StdRng, text: &mut Vec<u8>) {
    let is = |b: u8| b.is_ascii_digit() || b == b'.';
    let starts: Vec<usize> =
        (0..text.len()).filter(|i| is(text[*i]) && (*i == 0 || !is(text[i - 1]))).collect();
    if starts.is_empty() {
        return;
    }
    let from = starts[random.random_range(0..starts.len())];
    let to = from + text[from..].iter().take_while(|b| is(**b)).count();
    let drawn = match random.random_range(0..3) {
        0 => NUMBERS[random.random_range(0..NUMBERS.len())].to_string(),
        1 => random.random_range(-1000..1000).to_string(),
        _ => format!("{:e}", 10f64.powf(random.random_range(-12.0..12.0))),
    };
    drop(text.splice(from..to, drawn.bytes()));
}

fn insert(text: &mut Vec<u8>, at: usize, bytes: &[u8]) {
    drop(text.splice(at..at, bytes.iter().copied()));
}

/// Where a span begins and ends.
fn span(random: &mut StdRng, text: &[u8]) -> (usize, usize) {
    let from = random.random_range(0..=text.len());
    (from, (from + random.random_range(0..=SPAN)).min(text.len()))
}
