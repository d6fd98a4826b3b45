//! The container: an MCAP file, records one after the other, many of them in compressed chunks.
//!
//! A record is its kind (one byte), its length (eight) and as many bytes; numbers have the least significant byte first. Only the records
//! that describe or hold messages are read; lists of what stands where, at the end of a file, are not needed to read it from its beginning.

use std::io::{self, Read};

use super::Fault;
use crate::foreign::MCAP;

/// A record of more bytes than these is no record but damage.
const LARGEST: u64 = 1 << 32;
/// A chunk that claims to be larger than this once it is decompressed: recorders make a few megabytes.
const LARGEST_CHUNK: u64 = 1 << 30;

const DAMAGED: &str = "copy it again; `mcap recover BAG.mcap -o MENDED.mcap` keeps the chunks that are sound";

/// What a record says.
pub(super) enum Record<'a> {
    Schema { id: u16, name: &'a str, encoding: &'a str, text: &'a [u8] },
    Channel { id: u16, schema: u16, topic: &'a str, encoding: &'a str },
    Message { channel: u16, bytes: &'a [u8] },
}

/// How a file ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// With the end of its data.
    Whole,
    /// In the middle of a record, which begins at this byte, or in zeros from there on.
    Cut { at: u64 },
}

/// Why reading stopped.
pub(super) enum Stop {
    Read(io::Error),
    Fault(Fault),
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        Stop::Fault(fault)
    }
}

/// A fault of the container's bytes.
fn damaged(at: u64, what: &str) -> Fault {
    Fault::new(format!("byte {at}: {what}"), DAMAGED)
}

/// Calls `take` with every record that describes or holds messages, from the beginning of the data to their end.
///
/// # Errors
/// [`Stop`]: what the system says, damage with its byte, or what `take` says.
pub(super) fn records(
    mut input: impl Read,
    mut take: impl FnMut(Record) -> Result<(), Fault>,
) -> Result<End, Stop> {
    let mut start = Vec::new();
    read_up_to(&mut input, MCAP.len() as u64, &mut start)?;
    if start.is_empty() {
        return Ok(End::Cut { at: 0 });
    }
    if start != MCAP {
        return Err(damaged(0, "it does not begin as an MCAP file does").into());
    }
    let (mut at, mut head, mut body) = (MCAP.len() as u64, Vec::new(), Vec::new());
    loop {
        head.clear();
        read_up_to(&mut input, 9, &mut head)?;
        let (Some(kind), Some(length)) = (head.first(), head.get(1..9)) else { return Ok(End::Cut { at }) };
        let (kind, length) = (*kind, u64::from_le_bytes(length.try_into().unwrap_or_default()));
        if kind == 0 && length == 0 && is_zero(&mut input)? {
            // A recorder that lost its power had room on the disk, and nothing in it yet.
            return Ok(End::Cut { at });
        }
        if kind == 0 || length > LARGEST {
            return Err(damaged(at, "no record begins here, though one should").into());
        }
        let is_read = matches!(kind, SCHEMA | CHANNEL | MESSAGE | CHUNK);
        let found = if is_read {
            body.clear();
            read_up_to(&mut input, length, &mut body)?
        } else {
            io::copy(&mut (&mut input).take(length), &mut io::sink()).map_err(Stop::Read)?
        };
        match kind {
            _ if found < length => return Ok(End::Cut { at }),
            DATA_END | FOOTER => return Ok(End::Whole),
            CHUNK => chunk(&body, at, &mut take)?,
            _ if is_read => record(kind, &body, at, &mut take)?,
            _ => {}
        }
        at += 9 + length;
    }
}

const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const DATA_END: u8 = 0x0f;

/// As many bytes as there are, up to `length`, in memory that grows with what is there and not with what is claimed.
fn read_up_to(input: &mut impl Read, length: u64, bytes: &mut Vec<u8>) -> Result<u64, Stop> {
    input.take(length).read_to_end(bytes).map(|found| found as u64).map_err(Stop::Read)
}

/// Whether nothing but zeros is left.
fn is_zero(input: &mut impl Read) -> Result<bool, Stop> {
    let mut bytes = vec![0; 1 << 16];
    loop {
        match input.read(&mut bytes) {
            Ok(0) => return Ok(true),
            Ok(count) if bytes[..count].iter().any(|byte| *byte != 0) => return Ok(false),
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(Stop::Read(error)),
        }
    }
}

/// Fields of a record, one after the other; `None` behind its end.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn take(&mut self, count: u64) -> Option<&'a [u8]> {
        let (own, rest) = self.0.split_at_checked(usize::try_from(count).ok()?)?;
        self.0 = rest;
        Some(own)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N as u64)?.try_into().ok()
    }

    fn u16(&mut self) -> Option<u16> {
        self.number().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.number().map(u64::from_le_bytes)
    }

    fn bytes(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.take(length.into())
    }

    fn text(&mut self) -> Option<&'a str> {
        std::str::from_utf8(self.bytes()?).ok()
    }
}

type Take<'a> = dyn FnMut(Record) -> Result<(), Fault> + 'a;

fn record(kind: u8, body: &[u8], at: u64, take: &mut Take) -> Result<(), Fault> {
    let mut fields = Fields(body);
    let mut read = || {
        Some(match kind {
            SCHEMA => Record::Schema {
                id: fields.u16()?,
                name: fields.text()?,
                encoding: fields.text()?,
                text: fields.bytes()?,
            },
            CHANNEL => Record::Channel {
                id: fields.u16()?,
                schema: fields.u16()?,
                topic: fields.text()?,
                encoding: fields.text()?,
            },
            _ => {
                let channel = fields.u16()?;
                // Its number, when it was recorded, when it was published.
                let (_, _, _) = (fields.u32()?, fields.u64()?, fields.u64()?);
                Record::Message { channel, bytes: fields.0 }
            }
        })
    };
    let read = read().ok_or_else(|| damaged(at, "a record is shorter than what it holds"))?;
    take(read)
}

/// The records of a chunk.
fn chunk(body: &[u8], at: u64, take: &mut Take) -> Result<(), Fault> {
    let mut fields = Fields(body);
    let mut read = || {
        let (_first, _last) = (fields.u64()?, fields.u64()?);
        let (size, sum) = (fields.u64()?, fields.u32()?);
        let compression = fields.text()?;
        let length = fields.u64()?;
        Some((size, sum, compression, fields.take(length)?))
    };
    let (size, sum, compression, packed) =
        read().ok_or_else(|| damaged(at, "a chunk is shorter than what it holds"))?;
    if size > LARGEST_CHUNK {
        let what = format!("a chunk claims to hold {size} bytes");
        return Err(damaged(at, &what));
    }
    let mut unpacked = Vec::new();
    let records = match compression {
        "" => packed,
        "lz4" => unpack(lz4_flex::frame::FrameDecoder::new(packed), size, at, &mut unpacked)?,
        "zstd" => match zstd::Decoder::with_buffer(packed) {
            Ok(decoder) => unpack(decoder, size, at, &mut unpacked)?,
            Err(error) => return Err(damaged(at, &format!("a chunk cannot be decompressed: {error}"))),
        },
        other => {
            let what = format!(
                "byte {at}: a chunk is compressed by `{}`, which is not read",
                crate::wording::shown(other)
            );
            return Err(Fault::new(
                what,
                "write it anew: `mcap compress --compression zstd BAG.mcap -o NEW.mcap`",
            ));
        }
    };
    // Zero stands for none.
    if records.len() as u64 != size || (sum != 0 && sum != crc32(records)) {
        return Err(damaged(at, "a chunk does not have the sum that was taken of it"));
    }
    let mut rest = Fields(records);
    while !rest.0.is_empty() {
        let mut next = || {
            let [kind] = rest.number()?;
            let length = rest.u64()?;
            Some((kind, rest.take(length)?))
        };
        let (kind, body) =
            next().ok_or_else(|| damaged(at, "a record is longer than the chunk that holds it"))?;
        if matches!(kind, SCHEMA | CHANNEL | MESSAGE) {
            record(kind, body, at, take)?;
        }
    }
    Ok(())
}

/// What a chunk holds: no more than it claims, so that a few bytes do not fill the memory.
fn unpack(decoder: impl Read, size: u64, at: u64, bytes: &mut Vec<u8>) -> Result<&[u8], Fault> {
    let read = decoder.take(size + 1).read_to_end(bytes);
    read.map_err(|error| damaged(at, &format!("a chunk cannot be decompressed: {error}")))?;
    Ok(bytes)
}

/// The cyclic redundancy check of ISO 3309, as zip and PNG have it.
fn crc32(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = {
        let mut table = [0; 256];
        let mut n = 0;
        while n < 256 {
            let (mut c, mut k) = (n as u32, 0);
            while k < 8 {
                c = if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
                k += 1;
            }
            table[n] = c;
            n += 1;
        }
        table
    };
    !bytes.iter().fold(!0, |c, byte| TABLE[((c ^ u32::from(*byte)) & 0xff) as usize] ^ (c >> 8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_of_nine_digits_is_the_one_that_is_published() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
        assert_eq!(crc32(b""), 0);
    }
}
