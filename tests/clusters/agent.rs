//! `flyby site-agent`, the six scripts of thesis §C.3.1, by real processes on this machine.

use std::collections::BTreeSet;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use cluster::camp::Camp;
use cluster::orders::{
    Delete, End, Frame, Look, Order, Remove, Seen, Stands, Submit, TaskOrder, There, Wants, edges,
};
use model::Rect;
use serde::Serialize;
use wire::block::BlockRecord;
use wire::spool::{self, Entry};

use crate::harness::scenes::{FLYBY, TINY};
use crate::harness::{Farm, Place, wait};

const NAME: &str = "flyby-00c0ffee-test.1-1";

/// A camp on this machine, with a scene.
struct Desk {
    place: Place,
    camp: Camp,
    folder: PathBuf,
    scene: String,
}

impl Desk {
    fn new() -> Self {
        let place = Place::new();
        let text = format!(
            "[site.test]\nkind = 'local'\nfolder = '{}'\nprogram = '{}'\n",
            place.path("there").display(),
            env!("CARGO_BIN_EXE_flyby"),
        );
        let site = cluster::sites::parse("s", &text, None).unwrap().0.remove(0);
        let camp = Camp::new(site, "00c0ffee".into(), place.folder());
        let folder = PathBuf::from(camp.folder());
        // A coordinator makes a scene's bytes.
        let farm = Farm::new(&[]);
        let job = farm.submit(&[&[FLYBY, "--frames", "0"], &TINY[..]].concat());
        let file = farm.place.state().join(format!("jobs/{job}/scene/scene"));
        let bytes = fs::read(file).unwrap();
        let scene = scene::digest_of(&bytes).to_string();
        fs::create_dir_all(folder.join("scenes")).unwrap();
        fs::write(folder.join("scenes").join(&scene), bytes).unwrap();
        Self {
            place,
            camp,
            folder,
            scene,
        }
    }

    fn there(&self) -> There {
        There::of(&self.camp).unwrap()
    }

    /// Two tiles of the scene's first image.
    fn order(&self) -> Order {
        let task = |number: u64, tile| TaskOrder {
            attempt: (1, number),
            tile,
            wanted: Vec::new(),
        };
        Order {
            name: NAME.to_owned(),
            scene: self.scene.clone(),
            job: 1,
            image: 0,
            revision: render::REVISION,
            threads: 2,
            running_max: Some(1),
            time_limit: None,
            tasks: vec![task(1, [0, 0, 40, 60]), task(2, [40, 0, 80, 60])],
        }
    }

    fn call(&self, verb: &str, request: &impl Serialize) -> Output {
        let folder = self.folder.to_str().unwrap();
        let mut command = self.place.command(["site-agent", verb, "--folder", folder]);
        let child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        let mut child = child.unwrap();
        let request = serde_json::to_vec(request).unwrap();
        child.stdin.take().unwrap().write_all(&request).unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{verb}: {output:?}");
        output
    }

    fn run(&self, task: &str) -> Output {
        let folder = self.folder.to_str().unwrap();
        let words = ["--folder", folder, "--array", NAME, "--task", task];
        let mut command: Command = self.place.command(["site-agent", "run"]);
        command.args(words).output().unwrap()
    }

    fn submit(&self) -> String {
        let request = Submit {
            there: self.there(),
            order: self.order(),
        };
        String::from_utf8(self.call("sub", &request).stdout).unwrap()
    }

    fn look(&self, verb: &str, known: &[&str], offsets: &[Option<u64>]) -> (Seen, Vec<u8>) {
        self.look_but(verb, known, offsets, &[])
    }

    /// The same, without some blocks of each task.
    fn look_but(
        &self,
        verb: &str,
        known: &[&str],
        offsets: &[Option<u64>],
        but: &[Vec<[u32; 4]>],
    ) -> (Seen, Vec<u8>) {
        let request = Look {
            there: self.there(),
            known: known.iter().map(|&name| name.to_owned()).collect(),
            wants: vec![Wants {
                array: NAME.to_owned(),
                offsets: offsets.to_vec(),
                but: but.to_vec(),
            }],
            room: true,
        };
        let said = self.call(verb, &request).stdout;
        let line = said.iter().position(|&byte| byte == b'\n').unwrap();
        let seen = serde_json::from_slice(&said[..line]).unwrap();
        (seen, said[line + 1..].to_vec())
    }

    fn remove(&self) {
        let request = Remove {
            arrays: vec![NAME.to_owned()],
            files: vec![self.scene.clone()],
        };
        self.call("rm", &request);
    }

    fn wait_ended(&self) -> Seen {
        wait::until("all tasks have ended", || {
            let (seen, _) = self.look("ls", &[NAME], &[]);
            let tasks = &seen.arrays.first()?.tasks;
            let have_ended = tasks.iter().all(|task| task.0 == Stands::Ended);
            have_ended.then_some(seen)
        })
    }

    fn file(&self, task: u32) -> PathBuf {
        self.folder.join(format!("arrays/{NAME}/{task}.blocks"))
    }
}

/// Whatever becomes of a test, no process stays behind.
impl Drop for Desk {
    fn drop(&mut self) {
        let _ = self.camp.clean();
    }
}

/// The blocks of an answer, with the offsets after them, and how it ends. Those that were not wanted are left out.
fn frames(mut bytes: &[u8]) -> (Vec<(u32, u64, Rect)>, End) {
    let mut blocks = Vec::new();
    loop {
        let (frame, rest) = Frame::read(bytes).unwrap();
        bytes = rest;
        if let Some(end) = frame.end() {
            assert!(rest.is_empty());
            return (blocks, end);
        }
        if frame.entry.is_empty() {
            continue;
        }
        let Entry::Block(delivery, _) = spool::read(frame.entry) else {
            panic!("a damaged block");
        };
        let record = BlockRecord::only(&delivery.record).unwrap();
        assert_eq!(record.header.attempt.number, u64::from(frame.task));
        blocks.push((frame.task, frame.end, record.header.rect));
    }
}

fn blocks_of(tile: [u32; 4]) -> BTreeSet<Rect> {
    let [x0, y0, x1, y1] = tile;
    Rect { x0, y0, x1, y1 }.blocks().collect()
}

#[test]
fn an_image_goes_in_and_its_blocks_come_out_once() {
    let desk = Desk::new();
    let id = desk.submit();
    assert_eq!(desk.submit(), id, "submitting twice is submitting once");
    let seen = desk.wait_ended();
    let array = &seen.arrays[0];
    assert!(array.is_submitted && array.order.is_none());
    assert!(array.tasks.iter().all(|task| task.1 > 0));

    let (seen, bytes) = desk.look("get", &[], &[Some(0), None]);
    assert_eq!(seen.arrays[0].order, Some(desk.order()));
    assert_eq!(seen.files, std::slice::from_ref(&desk.scene));
    let (blocks, end) = frames(&bytes);
    assert_eq!(end, End::Whole);
    let found: BTreeSet<_> = blocks.iter().map(|block| block.2).collect();
    assert_eq!(found, blocks_of([0, 0, 40, 60]));
    assert_eq!(found.len(), blocks.len());

    // From where one has all but the last, the last alone comes.
    let before_last = blocks[blocks.len() - 2].1;
    let (_, bytes) = desk.look("get", &[], &[Some(before_last), None]);
    assert_eq!(frames(&bytes).0, blocks[blocks.len() - 1..]);
    let (_, bytes) = desk.look("get", &[], &[Some(blocks[blocks.len() - 1].1)]);
    assert_eq!(frames(&bytes).0, []);

    // A coordinator that comes after names what is durable: only the others come.
    let but: Vec<_> = [0, 2].map(|place: usize| edges(blocks[place].2)).to_vec();
    let (_, bytes) = desk.look_but("get", &[], &[Some(0), None], &[but]);
    let rest = (0..blocks.len()).filter(|&place| place != 0 && place != 2);
    let rest: Vec<_> = rest.map(|place| blocks[place]).collect();
    assert_eq!(frames(&bytes).0, rest);

    desk.remove();
    desk.remove();
    let (seen, _) = desk.look("ls", &[], &[]);
    assert_eq!(seen, Seen::default());
}

#[test]
fn a_task_goes_on_after_the_blocks_that_are_whole() {
    let desk = Desk::new();
    desk.submit();
    desk.wait_ended();
    for (keeps, more) in [(0, 0), (0, 50), (1, 0), (1, 7), (3, 99)] {
        let before = fs::read(desk.file(1)).unwrap();
        let kept = (0..keeps).fold(0, |at, _| at + spool::length(&before[at..]).unwrap());
        let length = kept + more;
        let file = OpenOptions::new().write(true).open(desk.file(1)).unwrap();
        file.set_len(length as u64).unwrap();
        let output = desk.run("1");
        assert!(output.status.success(), "{output:?}");
        let again = fs::read(desk.file(1)).unwrap();
        // What was whole stays where it was.
        assert!(again[..kept] == before[..kept]);
        let (_, bytes) = desk.look("get", &[NAME], &[Some(0)]);
        let blocks = frames(&bytes).0;
        let found: BTreeSet<_> = blocks.iter().map(|block| block.2).collect();
        assert_eq!((found, blocks.len()), (blocks_of([0, 0, 40, 60]), 4));
    }
}

#[test]
fn whoever_looks_ends_or_removes_makes_no_folder() {
    // A coordinator still asks after a site that was cleaned.
    let mut desk = Desk::new();
    let template = desk.place.write("t.sh", "#!/bin/sh\n@script@\n");
    desk.camp.site.template = Some(template);
    desk.submit();
    desk.wait_ended();
    desk.camp.clean().unwrap();
    let there = desk.place.path("there");
    let is_empty = || fs::read_dir(&there).unwrap().next().is_none();
    assert!(is_empty(), "it is cleaned");
    for verb in ["ls", "get"] {
        let (seen, _) = desk.look(verb, &[NAME], &[Some(0)]);
        assert_eq!(seen, Seen::default());
    }
    let request = Delete {
        there: desk.there(),
        tasks: vec![(NAME.to_owned(), None)],
    };
    desk.call("del", &request);
    desk.remove();
    assert!(is_empty(), "it is made again");
}

#[test]
fn what_cannot_be_rendered_is_said() {
    let desk = Desk::new();
    desk.submit();
    desk.wait_ended();
    let says = |task: &str, words: &str| {
        let output = desk.run(task);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains(words), "{said}");
    };
    says("3", "has no task 3");
    let file = desk.folder.join("scenes").join(&desk.scene);
    let mut bytes = fs::read(&file).unwrap();
    bytes[9] ^= 1;
    fs::write(&file, bytes).unwrap();
    fs::remove_file(desk.file(1)).unwrap();
    says("1", "is damaged");
    let order = Order {
        revision: render::REVISION + 1,
        ..desk.order()
    };
    let path = desk.folder.join(format!("arrays/{NAME}/order.json"));
    fs::write(path, serde_json::to_vec(&order).unwrap()).unwrap();
    says("1", "flyby site install");
}

#[test]
fn what_is_deleted_ends() {
    let desk = Desk::new();
    // Nobody can say how long: a program that never ends in the place of the task.
    let template = desk
        .place
        .write("t.sh", "#!/bin/sh\nsleep 1000\n@script@\n");
    let mut site = desk.camp.site.clone();
    site.template = Some(template);
    let camp = Camp::new(site, "00c0ffee".into(), desk.place.folder());
    let there = There::of(&camp).unwrap();
    let order = desk.order();
    let request = Submit {
        there: there.clone(),
        order,
    };
    desk.call("sub", &request);
    wait::until("the first task runs", || {
        let (seen, _) = desk.look("ls", &[NAME], &[]);
        let stands: Vec<_> = seen.arrays[0].tasks.iter().map(|task| task.0).collect();
        (stands == [Stands::Runs, Stands::Waits]).then_some(())
    });
    let mut request = Delete {
        there,
        tasks: vec![(NAME.to_owned(), Some(2)), ("nobody".to_owned(), None)],
    };
    desk.call("del", &request);
    let (seen, _) = desk.look("ls", &[NAME], &[]);
    assert_eq!(seen.arrays[0].tasks[0].0, Stands::Runs);
    assert_eq!(seen.arrays[0].tasks[1].0, Stands::Ended);
    request.tasks = vec![(NAME.to_owned(), None)];
    desk.call("del", &request);
    desk.wait_ended();
}
