//! A bag: its topics, and what of them is read.

use std::collections::{BTreeMap, HashMap};
use std::io::Read;
use std::path::Path;

use super::Fault;
use super::container::{self, End, Record, Stop};
use super::frames::Frames;
use super::message::{self, Kind, Posed};
use super::schema::Schema;
use super::track::Track;
use crate::error::{Error, Place, Result};

/// All that is read of a file, or of the files of one recording.
#[derive(Debug, Default)]
pub(crate) struct Bag {
    /// By name.
    pub topics: Vec<Topic>,
    /// Of all topics of TF together.
    pub frames: Frames,
    /// What is lost of each file whose end is missing.
    pub lost: Vec<String>,
}

/// Messages of one name and type.
#[derive(Clone, Debug)]
pub(crate) struct Topic {
    pub name: String,
    /// The name of the type as the bag has it.
    pub kind: String,
    pub messages: u64,
    pub holds: Holds,
    /// Why it is not read, with the first message that is not.
    pub fault: Option<Fault>,
}

/// What is read of a topic.
#[derive(Clone, Debug)]
pub(crate) enum Holds {
    Joints(Joints),
    Poses(Poses),
    /// It is in [`Bag::frames`].
    Frames,
    Other,
}

/// Positions of joints, rad or m.
#[derive(Clone, Debug, Default)]
pub(crate) struct Joints {
    /// In the order in which they came.
    pub names: Vec<String>,
    pub tracks: Vec<Track<f64>>,
    places: HashMap<String, usize>,
    /// Messages that have no positions.
    pub without: u64,
}

/// Poses of one frame in another one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Poses {
    pub track: Track<Posed>,
    /// The frame that they are in.
    pub frame: String,
    /// The frame that they are of; empty where no message names it.
    pub child: String,
}

impl Bag {
    /// Reads all of its files, one after the other, each with the name that messages use.
    ///
    /// # Errors
    /// [`Error::Input`] with the byte: what is damaged; [`Error::File`].
    pub fn read<'a>(files: Vec<(&'a Path, impl Read + 'a)>) -> Result<Bag> {
        let mut reader = Reader::default();
        let several = files.len() > 1;
        for (file, input) in files {
            let mut size = 0;
            let counted = Counted { input, size: &mut size };
            let end =
                container::records(counted, |record| reader.take(record)).map_err(|stop| match stop {
                    Stop::Read(source) => Error::file(file, source),
                    Stop::Fault(Fault { what, mend }) => Error::mistake(Place::file(file), what, mend),
                })?;
            // Each file numbers its types and channels anew.
            reader.schemas.clear();
            reader.channels.clear();
            if let End::Cut { at } = end {
                let lost = size - at.min(size);
                let of = if several { file.display().to_string() } else { "the bag".into() };
                let what = match size {
                    0 => format!("{of} is empty: nothing came to be written to it"),
                    _ => format!(
                        "{of} is cut off: it ends in a record that begins at byte {at} of {size}; these last {lost} bytes are lost, what stands before them is read"
                    ),
                };
                reader.bag.lost.push(what);
            }
        }
        let mut bag = reader.bag;
        bag.settle();
        Ok(bag)
    }

    fn settle(&mut self) {
        self.frames.settle();
        for topic in &mut self.topics {
            match &mut topic.holds {
                Holds::Joints(joints) => joints.tracks.iter_mut().for_each(Track::settle),
                Holds::Poses(poses) => poses.track.settle(),
                Holds::Frames | Holds::Other => {}
            }
        }
        self.topics.sort_by(|a, b| (&a.name, &a.kind).cmp(&(&b.name, &b.kind)));
    }
}

/// Counts what is read.
struct Counted<'a, R> {
    input: R,
    size: &'a mut u64,
}

impl<R: Read> Read for Counted<'_, R> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        let count = self.input.read(bytes)?;
        *self.size += count as u64;
        Ok(count)
    }
}

#[derive(Default)]
struct Reader {
    bag: Bag,
    schemas: BTreeMap<u16, Known>,
    /// Places of topics by number of channel.
    channels: BTreeMap<u16, Option<usize>>,
}

/// A type as the bag describes it.
struct Known {
    name: String,
    kind: Option<Kind>,
    fault: Option<Fault>,
}

impl Reader {
    fn take(&mut self, record: Record) -> std::result::Result<(), Fault> {
        match record {
            Record::Schema { id, name, encoding, text } => {
                let kind = Kind::named(name);
                let fault = kind.and_then(|_| Schema { name, encoding, text }.check().err());
                self.schemas.insert(id, Known { name: name.into(), kind, fault });
            }
            Record::Channel { id, schema, topic, encoding } => self.channel(id, schema, topic, encoding),
            Record::Message { channel, bytes } => match self.channels.get(&channel) {
                Some(Some(place)) => {
                    let Bag { topics, frames, .. } = &mut self.bag;
                    topics[*place].take(bytes, frames);
                }
                Some(None) => {}
                None => {
                    let what =
                        format!("a message is of channel {channel}, which nothing before it describes");
                    return Err(Fault::new(
                        what,
                        "write it anew with `mcap recover BAG.mcap -o MENDED.mcap`",
                    ));
                }
            },
        }
        Ok(())
    }

    fn channel(&mut self, id: u16, schema: u16, topic: &str, encoding: &str) {
        // Zero is no schema: messages that nothing describes.
        let Some(known) = self.schemas.get(&schema) else {
            self.channels.insert(id, None);
            return;
        };
        // Several senders on one topic have a channel each.
        let place = self.bag.topics.iter().position(|own| own.name == topic && own.kind == known.name);
        let place = place.unwrap_or_else(|| {
            let holds = match known.kind {
                Some(Kind::JointState) => Holds::Joints(Joints::default()),
                Some(Kind::Frames) => Holds::Frames,
                Some(Kind::Pose | Kind::Transform | Kind::Odometry) => Holds::Poses(Poses::default()),
                None => Holds::Other,
            };
            let fault = known.fault.clone().or_else(|| {
                let what = format!("its messages are written in `{encoding}`, not in `cdr`");
                let mend = "record it with `ros2 bag record --storage mcap`, or convert a bag of ROS 1 with `rosbags-convert`";
                (encoding != "cdr" && known.kind.is_some()).then(|| Fault::new(what, mend))
            });
            let (name, kind) = (topic.to_string(), known.name.clone());
            self.bag.topics.push(Topic { name, kind, messages: 0, holds, fault });
            self.bag.topics.len() - 1
        });
        self.channels.insert(id, Some(place));
    }
}

impl Topic {
    /// A message that is at fault makes its topic so, which matters only where it is asked for.
    fn take(&mut self, bytes: &[u8], frames: &mut Frames) {
        self.messages += 1;
        if self.fault.is_some() {
            return;
        }
        let read = match &mut self.holds {
            Holds::Joints(joints) => joints.take(bytes),
            Holds::Poses(poses) => Kind::named(&self.kind).map_or(Ok(()), |kind| poses.take(kind, bytes)),
            Holds::Frames => message::frames(bytes).map(|all| {
                let is_fixed = self.name.ends_with("tf_static");
                for one in all {
                    frames.push(one.header.frame, one.child, is_fixed, one.header.stamp, one.pose);
                }
            }),
            Holds::Other => Ok(()),
        };
        if let Err(what) = read {
            let what = format!("message {} is no {}: {what}", self.messages, self.kind);
            self.fault = Some(Fault::new(
                what,
                "record it anew; `mcap recover BAG.mcap -o MENDED.mcap` if the file was damaged",
            ));
        }
    }
}

impl Joints {
    fn take(&mut self, bytes: &[u8]) -> std::result::Result<(), String> {
        let state = message::joint_state(bytes)?;
        self.without += u64::from(state.positions.is_empty());
        for (name, position) in state.names.iter().zip(&state.positions) {
            let place = self.places.get(*name).copied().unwrap_or_else(|| {
                let place = self.names.len();
                self.places.insert((*name).into(), place);
                self.names.push((*name).into());
                self.tracks.push(Track::default());
                place
            });
            // A position that is none is a gap.
            if position.is_finite() {
                self.tracks[place].push(state.stamp, *position);
            }
        }
        Ok(())
    }
}

impl Poses {
    fn take(&mut self, kind: Kind, bytes: &[u8]) -> std::result::Result<(), String> {
        let stamped = message::stamped(kind, bytes)?;
        let (frame, child) = (stamped.header.frame, stamped.child);
        if self.track.points().is_empty() {
            (self.frame, self.child) = (frame.into(), child.into());
        } else if (&*self.frame, &*self.child) != (frame, child) {
            let of = |child: &str| if child.is_empty() { String::new() } else { format!(" of `{child}`") };
            let (own, other) = (of(&self.child), of(child));
            return Err(format!(
                "it is a pose{other} in frame `{frame}`, those before are{own} in frame `{}`",
                self.frame
            ));
        }
        self.track.push(stamped.header.stamp, stamped.pose);
        Ok(())
    }
}
