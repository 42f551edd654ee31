//! Files of triangles and rays, which any ray caster can take, and Embree on them where its development files are installed.

use glam::Vec3;
use relight_scene::rays::Ray;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Writes f32, little-endian.
fn write(file: &Path, values: impl Iterator<Item = f32>) {
    let bytes: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
    if let Err(error) = std::fs::write(file, bytes) {
        panic!("{}: {error}", file.display());
    }
}

/// `SCENE.tris`: three corners of each triangle, 9 f32.
pub fn dump_triangles(folder: &Path, scene: &str, positions: &[Vec3], triangles: &[[u32; 3]]) -> PathBuf {
    let file = folder.join(format!("{scene}.tris"));
    let corners = triangles.iter().flatten().map(|&i| positions[i as usize]);
    write(&file, corners.flat_map(|corner| corner.to_array()));
    file
}

/// `SCENE.KIND.rays`: origin, t_min, direction, t_max, 8 f32.
pub fn dump_rays(folder: &Path, scene: &str, kind: &str, rays: &[Ray]) -> PathBuf {
    let file = folder.join(format!("{scene}.{kind}.rays"));
    let values = rays.iter().flat_map(|ray| {
        let [origin, direction] = [ray.origin.to_array(), ray.direction.to_array()];
        [origin[0], origin[1], origin[2], ray.t_min].into_iter().chain([
            direction[0],
            direction[1],
            direction[2],
            ray.t_max,
        ])
    });
    write(&file, values);
    file
}

/// Compiles what times Embree into a folder; `None`, with a line that says why, where it cannot be.
pub fn compiled(folder: &Path) -> Option<PathBuf> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/rays/embree.cpp");
    let program = folder.join("embree");
    let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
    let mut command = Command::new(compiler);
    command.args(["-O3", "-march=native", "-std=c++17"]).arg(source);
    command.arg("-o").arg(&program).arg("-lembree3");
    let done = command.stderr(Stdio::null()).status();
    if done.is_ok_and(|status| status.success()) {
        return Some(program);
    }
    println!("Embree is not timed: {command:?} fails (Debian: libembree-dev)");
    None
}

/// Embree over the triangles of a scene, a process of its own.
pub struct Embree {
    process: Child,
    rounds: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Embree {
    pub fn new(program: &Path, triangles: &Path) -> Embree {
        let mut process = Command::new(program)
            .arg(triangles)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the compiled program starts");
        let rounds = process.stdin.take().expect("it is piped");
        let answers = BufReader::new(process.stdout.take().expect("it is piped"));
        Embree {
            process,
            rounds,
            answers,
        }
    }

    /// One round: hits and seconds. `mode` and `kind` as in embree.cpp.
    pub fn round(&mut self, mode: &str, kind: &str, rays: &Path) -> (usize, f64) {
        writeln!(self.rounds, "{mode} {kind} {}", rays.display()).expect("it listens");
        let mut answer = String::new();
        self.answers.read_line(&mut answer).expect("it answers");
        let (hits, seconds) = answer.trim().split_once(' ').expect("two numbers");
        (hits.parse().expect("a count"), seconds.parse().expect("seconds"))
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // It would end by itself as its input does; nothing of it is wanted any more.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
