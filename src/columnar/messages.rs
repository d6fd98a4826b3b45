//! Messages of Arrow, none of which claims more than it can hold.
//!
//! A stream is messages one after the other, a file has a list of them at its end. The library's readers believe what a compressed buffer
//! says of its size, and ask for that much memory: damage must not end the program.

use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom};

use arrow_ipc::{MessageHeader, RecordBatch, root_as_footer, root_as_message};

/// How a file ends, behind the four bytes that say how long its list of batches is.
const MARK: &[u8] = b"ARROW1";
const END: u64 = 10;
const CONTINUES: [u8; 4] = [0xff; 4];
/// No buffer becomes larger by being unpacked; zstd at its best makes 2^15 bytes of one.
const RATIO: u64 = 1 << 16;
/// Offsets of text count up to here.
const LARGEST: u64 = 1 << 31;

/// Looks at all messages that the list at the end of a file names; then the file stands where it stood.
///
/// # Errors
/// The list is missing, or a message is not sound.
pub(super) fn check_file<R: Read + Seek>(input: &mut R) -> Result<()> {
    let length = input.seek(SeekFrom::End(0))?;
    let mut part = |from: u64, size: u64| -> Result<Vec<u8>> {
        if from.checked_add(size).is_none_or(|to| to > length) {
            return Err(wrong("its end is missing"));
        }
        input.seek(SeekFrom::Start(from))?;
        let mut bytes = Vec::new();
        input.by_ref().take(size).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let last = part(length.saturating_sub(END), END)?;
    let size = last.first_chunk().map_or(-1, |size| i32::from_le_bytes(*size));
    let size = u64::try_from(size).ok().filter(|size| last.ends_with(MARK) && *size + END <= length);
    let size = size.ok_or_else(|| wrong("its end is missing"))?;
    let list = part(length - END - size, size)?;
    let list = root_as_footer(&list).map_err(|_| wrong("the list of its batches has no form"))?;
    for block in list.dictionaries().into_iter().chain(list.recordBatches()).flatten() {
        let [from, head, body] = [block.offset(), block.metaDataLength().into(), block.bodyLength()]
            .map(|number| u64::try_from(number).unwrap_or(u64::MAX));
        let (head, body) = (part(from, head)?, part(from.saturating_add(head), body)?);
        let prefix = if head.starts_with(&CONTINUES) { 8 } else { 4 };
        sound(head.get(prefix..).unwrap_or_default(), &body)?;
    }
    input.rewind()
}

fn wrong(what: &str) -> Error {
    Error::new(ErrorKind::InvalidData, what.to_string())
}

/// Whether every buffer of a message unpacks to what it says.
fn sound(head: &[u8], body: &[u8]) -> Result<()> {
    let message = root_as_message(head).map_err(|_| wrong("a message has no form"))?;
    let batch = match message.header_type() {
        MessageHeader::RecordBatch => message.header_as_record_batch(),
        MessageHeader::DictionaryBatch => message.header_as_dictionary_batch().and_then(|d| d.data()),
        _ => None,
    };
    match batch {
        Some(batch) if !unpacks(&batch, body) => Err(wrong("a compressed buffer claims an impossible size")),
        _ => Ok(()),
    }
}

/// Gives the bytes of a source, message by message, as far as they are sound.
pub(super) struct Messages {
    source: Box<dyn Read + Send>,
    /// The message that is being read, and how far it has been.
    message: Vec<u8>,
    read: usize,
    ended: bool,
}

impl Messages {
    /// The source stands at the first message.
    pub fn new(source: Box<dyn Read + Send>) -> Messages {
        Messages { source, message: Vec::new(), read: 0, ended: false }
    }

    fn next(&mut self) -> Result<()> {
        (self.read, self.message) = (0, std::mem::take(&mut self.message));
        self.message.clear();
        // The end of a source in the middle of a message would be taken for that of all messages.
        let mut length = self.take(4)?;
        if length == CONTINUES {
            length = self.take(4)?;
        }
        let length = match length.try_into() {
            Ok(length) => u32::from_le_bytes(length),
            // A stream may end without its last word.
            Err(_) if length.is_empty() && self.message.is_empty() => 0,
            Err(_) => return Err(wrong("a message is cut short")),
        };
        let from = self.message.len();
        if length == 0 {
            self.ended = true;
            return Ok(());
        }
        if self.take(length.into())?.len() as u64 != u64::from(length) {
            return Err(wrong("a message is cut short"));
        }
        let (head, body) = {
            let head = root_as_message(&self.message[from..]).map_err(|_| wrong("a message has no form"))?;
            let body = u64::try_from(head.bodyLength()).map_err(|_| wrong("a message has no length"))?;
            (self.message.len(), body)
        };
        if self.take(body)?.len() as u64 != body {
            return Err(wrong("a message is cut short"));
        }
        let (head, body) = self.message.split_at(head);
        sound(&head[from..], body)
    }

    /// Appends so many bytes of the source to the message, or what is left of it; what was appended.
    fn take(&mut self, length: u64) -> Result<&[u8]> {
        let from = self.message.len();
        self.source.by_ref().take(length).read_to_end(&mut self.message)?;
        Ok(&self.message[from..])
    }
}

/// Whether every buffer of a batch is within the body, and says a size that it can unpack to.
fn unpacks(batch: &RecordBatch, body: &[u8]) -> bool {
    let is_compressed = batch.compression().is_some();
    batch.buffers().into_iter().flatten().all(|buffer| {
        let (Ok(from), Ok(length)) = (usize::try_from(buffer.offset()), usize::try_from(buffer.length()))
        else {
            return false;
        };
        let Some(bytes) = from.checked_add(length).and_then(|to| body.get(from..to)) else { return false };
        match bytes.first_chunk::<8>() {
            Some(size) if is_compressed => {
                // -1 says that it is as it was.
                let size = i64::from_le_bytes(*size);
                let most = (length as u64).saturating_mul(RATIO).min(LARGEST);
                size == -1 || u64::try_from(size).is_ok_and(|size| size <= most)
            }
            _ => true,
        }
    })
}

impl Read for Messages {
    fn read(&mut self, out: &mut [u8]) -> Result<usize> {
        if self.read == self.message.len() && !self.ended {
            self.next()?;
        }
        let rest = &self.message[self.read..];
        let length = rest.len().min(out.len());
        out[..length].copy_from_slice(&rest[..length]);
        self.read += length;
        Ok(length)
    }
}
