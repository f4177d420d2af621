//! What a coordinator and `flyby site-agent` on a login node say to each other (thesis §C.3.1): JSON on standard input,
//! and on standard output a line of JSON, behind which finished blocks follow as they are.
//!
//! In the camp's folder there:
//!
//! ```text
//! arrays/NAME/order.json     what is to be rendered
//! arrays/NAME/id             the queue's number of the array, once it was submitted
//! arrays/NAME/TASK.blocks    finished blocks, one after the other (`wire::spool`)
//! scenes/DIGEST              scene descriptions and assets
//! template                   the site's own template of a task's script
//! ```

use std::fs;
use std::path::Path;

use model::{AttemptId, Digest, Epoch, ImageNumber, ImageRef, JobId, Lease, Rect, Revision, Span};
use serde::{Deserialize, Serialize};

use crate::camp::Camp;
use crate::error::ClusterError;
use crate::sites::{Site, microseconds};
use crate::template::END;
use crate::words::{quote, quote_path};

/// Most bytes of blocks that one call brings.
pub const FETCH_BYTES_MAX: u64 = 16 << 20;

/// Most blocks that one call brings.
pub const FETCH_BLOCKS_MAX: u32 = 4_096;

/// Bytes before each block of an answer: whose it is.
pub const FRAME_BYTES: usize = 4 + 4 + 8 + 4;

/// The template of a site that has one of its own, in the camp's folder.
const TEMPLATE_FILE: &str = "template";

/// A site, as its own login node needs it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct There {
    site: Site,
    farm: String,
    /// The text of a template of its own.
    template: Option<String>,
}

impl There {
    /// The site of a camp. Fails where its template cannot be read.
    pub fn of(camp: &Camp) -> Result<Self, ClusterError> {
        let read = |path: &std::path::PathBuf| {
            fs::read_to_string(path).map_err(|source| ClusterError::File {
                attempted: "read the template",
                path: path.display().to_string(),
                source,
            })
        };
        Ok(Self {
            template: camp.site.template.as_ref().map(read).transpose()?,
            farm: camp.farm().to_owned(),
            site: Site {
                address: None,
                ssh_options: Vec::new(),
                // It ran before the agent was called.
                setup: None,
                template: None,
                ..camp.site.clone()
            },
        })
    }

    /// Writes the template, where there is one, into the folder of the camp: what submits by it needs it.
    pub fn put_template(&self, folder: &Path) -> Result<(), ClusterError> {
        let Some(text) = &self.template else {
            return Ok(());
        };
        let path = folder.join(TEMPLATE_FILE);
        if fs::read_to_string(&path).ok().as_ref() == Some(text) {
            return Ok(());
        }
        fs::write(&path, text).map_err(|source| ClusterError::File {
            attempted: "write the template",
            path: path.display().to_string(),
            source,
        })
    }

    /// The camp, in its folder there. Nothing is made.
    pub fn camp(mut self, folder: &Path) -> Camp {
        let template = self.template.map(|_| folder.join(TEMPLATE_FILE));
        self.site.template = template;
        Camp::new(self.site, self.farm, folder)
    }
}

/// An image, or the rest of one, to be rendered as an array: a task for each tile.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Order {
    /// The array's name.
    pub name: String,
    /// The digest of the scene description.
    pub scene: String,
    /// The job.
    pub job: u64,
    /// The image's number in its animation.
    pub image: u32,
    /// The renderer's revision.
    pub revision: u32,
    /// Render threads of a task.
    pub threads: u32,
    /// Most tasks that run at a time.
    pub running_max: Option<u32>,
    /// How long a task may run; none: as long as the queue lets it.
    #[serde(with = "microseconds::perhaps")]
    pub time_limit: Option<Span>,
    /// The tasks, from number 1 on.
    pub tasks: Vec<TaskOrder>,
}

/// A tile.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct TaskOrder {
    /// Epoch and number of the attempt.
    pub attempt: (u64, u64),
    /// Its pixels: x0, y0, x1, y1.
    pub tile: [u32; 4],
    /// The blocks that are wanted, in order; none: all.
    pub wanted: Vec<[u32; 4]>,
}

impl Order {
    /// Which image.
    pub fn image(&self) -> ImageRef {
        ImageRef {
            job: JobId(self.job),
            image: ImageNumber(self.image),
        }
    }

    /// The revision that its blocks must have.
    pub fn revision(&self) -> Revision {
        Revision(self.revision)
    }

    /// What a task renders; `None` where there is no such task, or the order was damaged.
    pub fn lease(&self, task: u32) -> Option<Lease> {
        let place = usize::try_from(task.checked_sub(1)?).ok()?;
        let task = self.tasks.get(place)?;
        let lease = Lease {
            attempt: AttemptId {
                epoch: Epoch(task.attempt.0),
                number: task.attempt.1,
            },
            image: self.image(),
            scene: self.scene.parse::<Digest>().ok()?,
            tile: rect(task.tile),
            wanted: task.wanted.iter().copied().map(rect).collect(),
            expected: Span(0),
        };
        let are_blocks = lease
            .wanted
            .iter()
            .all(|block| block.is_block() && lease.tile.contains(*block));
        (are_blocks && !lease.tile.is_empty()).then_some(lease)
    }
}

impl From<&Lease> for TaskOrder {
    fn from(lease: &Lease) -> Self {
        Self {
            attempt: (lease.attempt.epoch.0, lease.attempt.number),
            tile: edges(lease.tile),
            wanted: lease.wanted.iter().copied().map(edges).collect(),
        }
    }
}

/// A rectangle's edges: x0, y0, x1, y1.
pub fn edges(rect: Rect) -> [u32; 4] {
    [rect.x0, rect.y0, rect.x1, rect.y1]
}

fn rect([x0, y0, x1, y1]: [u32; 4]) -> Rect {
    Rect { x0, y0, x1, y1 }
}

/// `sub`: submit an array. Answered by the queue's number of it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Submit {
    /// Where.
    pub there: There,
    /// What.
    pub order: Order,
}

/// `ls` and `get`: how everything stands, and blocks that are there beyond what the coordinator has.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Look {
    /// Where.
    pub there: There,
    /// Arrays whose orders need not be told.
    pub known: Vec<String>,
    /// Arrays whose blocks are wanted.
    pub wants: Vec<Wants>,
    /// Whether it is to be tried if there is room for more; coordinators of before always wanted that.
    #[serde(default = "always")]
    pub room: bool,
}

fn always() -> bool {
    true
}

/// Of which tasks of an array blocks are wanted.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Wants {
    /// The array.
    pub array: String,
    /// For each task from 1 on, how many bytes of its file the coordinator has; none: no more is wanted.
    pub offsets: Vec<Option<u64>>,
    /// Blocks of each task that are not wanted, though they may lie beyond that; nothing where there are none of any.
    #[serde(default)]
    pub but: Vec<Vec<[u32; 4]>>,
}

/// `del`: end what is live of these, whole arrays or single tasks.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Delete {
    /// Where.
    pub there: There,
    /// By the array's name.
    pub tasks: Vec<(String, Option<u32>)>,
}

/// `rm`: remove what nobody needs.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Remove {
    /// Arrays, by name.
    pub arrays: Vec<String>,
    /// Scene descriptions and assets, by digest.
    pub files: Vec<String>,
}

/// How everything stands: the answer's first line.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Seen {
    /// The arrays in the camp's folder.
    pub arrays: Vec<SeenArray>,
    /// The scene descriptions and assets that are there.
    pub files: Vec<String>,
    /// What is said there to whoever would write more; nothing where there is room.
    #[serde(default)]
    pub full: Option<String>,
}

/// How an array stands.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct SeenArray {
    /// Its name.
    pub name: String,
    /// Whether the queue has taken it.
    pub is_submitted: bool,
    /// Its order, where it is told.
    pub order: Option<Order>,
    /// Its tasks, from number 1 on.
    pub tasks: Vec<SeenTask>,
}

/// How a task stands, and how many bytes its file has.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct SeenTask(pub Stands, pub u64);

/// How a task stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stands {
    /// It waits in the queue.
    Waits,
    /// It runs, or is being ended.
    Runs,
    /// The queue shows it as running, on a host of which it hears nothing.
    Away,
    /// It will not go on.
    Ended,
    /// It will not go on, since it could not write what it had rendered.
    Full,
}

impl Stands {
    /// Whether it goes on, or may.
    pub fn is_live(self) -> bool {
        !matches!(self, Self::Ended | Self::Full)
    }
}

/// A block of an answer: whose it is, and its entry in the task's file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Frame<'a> {
    /// The place of the array in [`Look::wants`].
    pub array: u32,
    /// The task's number.
    pub task: u32,
    /// Where its entry ends in the task's file.
    pub end: u64,
    /// The entry; nothing where its block is not wanted.
    pub entry: &'a [u8],
}

/// What ends an answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum End {
    /// All that was there is told.
    Whole,
    /// There is more than one call brings.
    More,
}

impl End {
    /// What stands at an answer's end, in a frame's place.
    pub fn bytes(self) -> [u8; FRAME_BYTES] {
        Frame::head(u32::MAX, u32::from(self == Self::More), 0, 0)
    }
}

impl<'a> Frame<'a> {
    /// Whether it is no block but the end of an answer, and which.
    pub fn end(&self) -> Option<End> {
        let end = match self.task {
            0 => End::Whole,
            _ => End::More,
        };
        (self.array == u32::MAX).then_some(end)
    }

    /// What stands before an entry of so many bytes.
    pub fn head(array: u32, task: u32, end: u64, bytes: u32) -> [u8; FRAME_BYTES] {
        let mut head = [0; FRAME_BYTES];
        head[..4].copy_from_slice(&array.to_le_bytes());
        head[4..8].copy_from_slice(&task.to_le_bytes());
        head[8..16].copy_from_slice(&end.to_le_bytes());
        head[16..].copy_from_slice(&bytes.to_le_bytes());
        head
    }

    /// The first block of an answer, and what follows it; `None` where none is whole.
    pub fn read(bytes: &'a [u8]) -> Option<(Self, &'a [u8])> {
        let (head, rest) = bytes.split_first_chunk::<FRAME_BYTES>()?;
        let word = |at: usize| {
            let mut word = [0; 4];
            word.copy_from_slice(&head[at..at + 4]);
            u32::from_le_bytes(word)
        };
        let mut end = [0; 8];
        end.copy_from_slice(&head[8..16]);
        let (entry, rest) = rest.split_at_checked(word(16) as usize)?;
        let frame = Self {
            array: word(0),
            task: word(4),
            end: u64::from_le_bytes(end),
            entry,
        };
        Some((frame, rest))
    }
}

/// The script that calls the agent at a site.
pub fn call(camp: &Camp, verb: &str, request: &impl Serialize) -> Result<String, ClusterError> {
    let request = serde_json::to_string(request).map_err(|error| ClusterError::Nonsense {
        attempt: format!("asking for {verb}"),
        what: error.to_string(),
        said: String::new(),
    })?;
    let program = quote_path(&camp.site.program);
    let folder = quote_path(&camp.folder());
    Ok(format!(
        "{program} site-agent {verb} --folder {folder} <<'{END}'\n{request}\n{END}"
    ))
}

/// The script of an array's tasks.
pub fn task_script(camp: &Camp, order: &Order) -> String {
    let program = quote_path(&camp.site.program);
    let folder = quote_path(&camp.folder());
    let name = quote(&order.name);
    format!("exec {program} site-agent run --folder {folder} --array {name} --task \"$FLYBY_TASK\"")
}

/// Where a file of a scene lies there.
pub fn scene_file(camp: &Camp, digest: Digest) -> String {
    format!("{}/scenes/{digest}", camp.folder())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sites;

    #[test]
    fn what_is_framed_is_read_and_a_cut_gives_the_whole_ones() {
        let mut bytes = Frame::head(3, 7, 1 << 40, 5).to_vec();
        bytes.extend(b"block");
        bytes.extend(Frame::head(3, 8, 9, 4));
        bytes.extend(b"cut");
        let (frame, rest) = Frame::read(&bytes).unwrap();
        let expected = Frame {
            array: 3,
            task: 7,
            end: 1 << 40,
            entry: b"block",
        };
        assert_eq!(frame, expected);
        assert_eq!(Frame::read(rest), None);
        assert_eq!(frame.end(), None);
        let end = End::More.bytes();
        assert_eq!(Frame::read(&end).unwrap().0.end(), Some(End::More));
    }

    #[test]
    fn a_site_is_told_without_the_way_there_and_with_its_template() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("t.sh"), "x\n@script@\n").unwrap();
        let text = "[site.a]\nkind = 'slurm'\naddress = 'me@there'\nsetup = 'module load slurm'\n\
                    time_limit = '2 h'\ntemplate = 't.sh'\n";
        let site = sites::parse("s", text, Some(folder.path()))
            .unwrap()
            .0
            .remove(0);
        let camp = Camp::new(site, "00c0ffee".into(), Path::new("/x"));
        let text = serde_json::to_string(&There::of(&camp).unwrap()).unwrap();
        assert!(
            !text.contains("me@there") && !text.contains("module"),
            "{text}"
        );
        let there: There = serde_json::from_str(&text).unwrap();
        let farm = folder.path().join("farm");
        let looked = there.clone().camp(&farm);
        assert!(!farm.exists(), "a look makes nothing");
        assert_eq!(looked.prefix(), camp.prefix());
        fs::create_dir(&farm).unwrap();
        there.put_template(&farm).unwrap();
        let camp_there = there.camp(&farm);
        assert_eq!(camp_there.prefix(), camp.prefix());
        assert_eq!(camp_there.site.time_limit, Some(Span::from_secs(7_200)));
        let template = fs::read_to_string(camp_there.site.template.unwrap()).unwrap();
        assert_eq!(template, "x\n@script@\n");
    }

    #[test]
    fn an_order_that_names_no_block_of_its_tile_is_none() {
        let mut order = Order {
            name: "a".into(),
            scene: Digest([7; 32]).to_string(),
            job: 1,
            image: 2,
            revision: 3,
            threads: 1,
            running_max: None,
            time_limit: None,
            tasks: vec![TaskOrder {
                attempt: (4, 5),
                tile: [0, 0, 50, 50],
                wanted: vec![[32, 0, 50, 32]],
            }],
        };
        let lease = order.lease(1).unwrap();
        assert_eq!(TaskOrder::from(&lease), order.tasks[0]);
        assert_eq!(order.lease(0), None);
        assert_eq!(order.lease(2), None);
        order.tasks[0].wanted[0][2] = 64;
        assert_eq!(order.lease(1), None);
    }
}
