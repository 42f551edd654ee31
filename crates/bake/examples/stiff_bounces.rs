//! Which solver for the bounces of stiff scenes? Products with the operator until one more bounce changes at most
//! 0.01·(1 − ρ) of the brightest place, and what the light is then off by: the command behind docs/notebook/stability.md.
//!
//! `cargo run --release -p relight-bake --example stiff_bounces`, in the repository root. Takes a minute or two.
//!
//! Light is uneven: one cluster in eight emits, one of them a hundred times as much as the others. Contestants: the
//! Neumann series; Anderson acceleration of it (depth 5); BiCGSTAB; conjugate gradients on the operator made symmetric
//! by its clusters' masses, which is another operator; two levels of the sender tree (two bounces, then the residual's
//! means solved exactly on the coarsest clusters); and GMRES, which the library uses.

use glam::Vec3;
use relight_bake::params::{BakeParams, Preset};
use relight_bake::{Request, Unwatched, bake};
use relight_scene::gltf::{ImportOptions, import};
use relight_scene::traced::Shading;
use relight_transport::bounce::{TOLERANCE, solve_double};
use relight_transport::random::Stream;
use relight_transport::senders::weight;
use relight_transport::sparse::{SparseMatrix, build, largest_row_sum, row};
use relight_transport::spectrum::spectral_radius;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

/// An operator with what the contestants want to know of it.
struct Room {
    name: String,
    k: SparseMatrix,
    /// Importance of each cluster.
    mass: Vec<f64>,
    /// Each cluster's parent on the coarsest level, and their number.
    parent: (Vec<u32>, usize),
}

/// E = K (b + ρ E), and how many products were spent on it.
struct Problem<'a> {
    room: &'a Room,
    rho: f64,
    emitted: Vec<f64>,
    products: std::cell::Cell<u32>,
}

impl Problem<'_> {
    fn k(&self, v: &[f64]) -> Vec<f64> {
        self.products.set(self.products.get() + 1);
        (0..v.len())
            .map(|i| {
                row(&self.room.k, i)
                    .map(|(j, w)| f64::from(w) * v[j as usize])
                    .sum()
            })
            .collect()
    }

    /// K ρ v.
    fn reflected(&self, v: &[f64]) -> Vec<f64> {
        let mut out = self.k(v);
        out.iter_mut().for_each(|x| *x *= self.rho);
        out
    }

    /// One bounce after x, and whether it changed little enough.
    fn next(&self, x: &[f64]) -> (Vec<f64>, bool) {
        let sent: Vec<f64> = x
            .iter()
            .zip(&self.emitted)
            .map(|(x, b)| b + self.rho * x)
            .collect();
        let next = self.k(&sent);
        let change = next.iter().zip(x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let done = change <= TOLERANCE * (1.0 - self.rho) * largest(&next);
        (next, done)
    }
}

fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m, x| m.max(x.abs()))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Products after which a contestant gives up.
const GIVE_UP: u32 = 20_000;

fn neumann(p: &Problem) -> Vec<f64> {
    let mut x = vec![0.0; p.emitted.len()];
    while p.products.get() < GIVE_UP {
        let (next, done) = p.next(&x);
        x = next;
        if done {
            break;
        }
    }
    x
}

/// Anderson 1965 as Walker and Ni 2011 write it, by normal equations of at most five differences.
fn anderson(p: &Problem) -> Vec<f64> {
    const DEPTH: usize = 5;
    let n = p.emitted.len();
    let mut x = vec![0.0; n];
    let mut history: Vec<(Vec<f64>, Vec<f64>)> = Vec::new();
    let mut before: Option<(Vec<f64>, Vec<f64>)> = None;
    while p.products.get() < GIVE_UP {
        let (g, done) = p.next(&x);
        if done {
            return g;
        }
        let f: Vec<f64> = g.iter().zip(&x).map(|(g, x)| g - x).collect();
        if let Some((old_g, old_f)) = &before {
            let difference = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
            history.push((difference(&g, old_g), difference(&f, old_f)));
            if history.len() > DEPTH {
                history.remove(0);
            }
        }
        let m = history.len();
        let mut a = vec![vec![0.0; m + 1]; m];
        for i in 0..m {
            for j in 0..m {
                a[i][j] = dot(&history[i].1, &history[j].1);
            }
            a[i][i] *= 1.0 + 1e-12;
            a[i][m] = dot(&history[i].1, &f);
        }
        let gamma = solved(a);
        let mut next = g.clone();
        for (gamma, (dg, _)) in gamma.iter().zip(&history) {
            next.iter_mut().zip(dg).for_each(|(x, d)| *x -= gamma * d);
        }
        before = Some((g, f));
        x = next;
    }
    x
}

/// Van der Vorst 1992.
fn bicgstab(p: &Problem) -> Vec<f64> {
    let n = p.emitted.len();
    let a = |v: &[f64]| -> Vec<f64> { v.iter().zip(p.reflected(v)).map(|(v, r)| v - r).collect() };
    let mut x = vec![0.0; n];
    let mut r = p.k(&p.emitted);
    let shadow = r.clone();
    let mut d = r.clone();
    let mut rho = dot(&shadow, &r);
    while p.products.get() < GIVE_UP {
        let v = a(&d);
        let alpha = rho / dot(&shadow, &v);
        let s: Vec<f64> = r.iter().zip(&v).map(|(r, v)| r - alpha * v).collect();
        let t = a(&s);
        let omega = dot(&t, &s) / dot(&t, &t);
        for i in 0..n {
            x[i] += alpha * d[i] + omega * s[i];
            r[i] = s[i] - omega * t[i];
        }
        if largest(&r) <= TOLERANCE * (1.0 - p.rho) * largest(&x) {
            break;
        }
        let next = dot(&shadow, &r);
        let beta = next / rho * (alpha / omega);
        for i in 0..n {
            d[i] = r[i] + beta * (d[i] - omega * v[i]);
        }
        rho = next;
    }
    x
}

/// Hestenes and Stiefel 1952 in the masses' inner product, for M⁻¹ (M K + Kᵀ M)/2 in place of K.
fn symmetric(p: &Problem) -> Vec<f64> {
    let (n, mass) = (p.emitted.len(), &p.room.mass);
    let transposed = p.room.k.transpose_view().to_csr();
    let even = |v: &[f64]| -> Vec<f64> {
        let there = p.k(v);
        (0..n)
            .map(|i| {
                let back: f64 = row(&transposed, i)
                    .map(|(j, w)| f64::from(w) * mass[j as usize] * v[j as usize])
                    .sum();
                0.5 * (there[i] + if mass[i] > 0.0 { back / mass[i] } else { 0.0 })
            })
            .collect()
    };
    let inner =
        |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).zip(mass).map(|((a, b), m)| a * b * m).sum() };
    let mut x = vec![0.0; n];
    let mut r = even(&p.emitted);
    let mut d = r.clone();
    let mut rr = inner(&r, &r);
    while p.products.get() < GIVE_UP {
        let a: Vec<f64> = d.iter().zip(even(&d)).map(|(d, k)| d - p.rho * k).collect();
        let alpha = rr / inner(&d, &a);
        for i in 0..n {
            x[i] += alpha * d[i];
            r[i] -= alpha * a[i];
        }
        if largest(&r) <= TOLERANCE * (1.0 - p.rho) * largest(&x) {
            break;
        }
        let next = inner(&r, &r);
        let beta = next / rr;
        d.iter_mut().zip(&r).for_each(|(d, r)| *d = r + beta * *d);
        rr = next;
    }
    x
}

/// Two bounces, then the means of what is left over the coarsest clusters, solved there (aggregation).
fn two_levels(p: &Problem) -> Vec<f64> {
    let (n, (parent, coarse)) = (p.emitted.len(), &p.room.parent);
    let mut mass = vec![0.0; *coarse];
    (0..n).for_each(|i| mass[parent[i] as usize] += p.room.mass[i]);
    let mut matrix = vec![vec![0.0; coarse + 1]; *coarse];
    for i in 0..n {
        let share = if mass[parent[i] as usize] > 0.0 {
            p.room.mass[i] / mass[parent[i] as usize]
        } else {
            0.0
        };
        for (j, w) in row(&p.room.k, i) {
            matrix[parent[i] as usize][parent[j as usize] as usize] -= share * f64::from(w) * p.rho;
        }
    }
    (0..*coarse).for_each(|i| matrix[i][i] += 1.0);
    let mut x = vec![0.0; n];
    while p.products.get() < GIVE_UP {
        x = p.next(&p.next(&x).0).0;
        let (next, done) = p.next(&x);
        if done {
            return next;
        }
        let mut system = matrix.clone();
        for i in 0..n {
            let c = parent[i] as usize;
            if mass[c] > 0.0 {
                system[c][*coarse] += p.room.mass[i] / mass[c] * (next[i] - x[i]);
            }
        }
        let correction = solved(system);
        (0..n).for_each(|i| x[i] += correction[parent[i] as usize]);
    }
    x
}

/// Gaussian elimination with row pivoting; the last column is the right-hand side.
fn solved(mut a: Vec<Vec<f64>>) -> Vec<f64> {
    let n = a.len();
    for i in 0..n {
        let pivot = (i..n)
            .max_by(|&p, &q| a[p][i].abs().total_cmp(&a[q][i].abs()))
            .unwrap_or(i);
        a.swap(i, pivot);
        if a[i][i] == 0.0 {
            continue;
        }
        let row = a[i].clone();
        for other in a.iter_mut().skip(i + 1) {
            let factor = other[i] / row[i];
            if factor != 0.0 {
                other
                    .iter_mut()
                    .zip(&row)
                    .skip(i)
                    .for_each(|(o, r)| *o -= factor * r);
            }
        }
    }
    let mut x = vec![0.0; n];
    for i in (0..n).rev() {
        let rest: f64 = (i + 1..n).map(|j| a[i][j] * x[j]).sum();
        x[i] = if a[i][i] == 0.0 {
            0.0
        } else {
            (a[i][n] - rest) / a[i][i]
        };
    }
    x
}

fn baked(name: &str) -> Result<Room, Box<dyn Error>> {
    let scene = Arc::new(import(
        &Path::new("data").join(name).with_extension("glb"),
        &ImportOptions::default(),
    )?);
    let params = BakeParams::preset(Preset::Draft);
    let request = Request {
        shading: Shading::Lambert,
        ..Request::new(scene, &params)
    };
    let asset = bake(&request, None, &Unwatched)?.asset;
    let (Some(bounce), Some(senders)) = (asset.bounce, asset.senders) else {
        return Err(format!("{name} has no bounces").into());
    };
    let level = bounce.level as usize;
    let mut of = senders.leaf_of_point.clone();
    for parents in senders.parents[level..].iter().rev() {
        of.iter_mut().for_each(|c| *c = parents[*c as usize]);
    }
    let mut mass = vec![0.0; bounce.matrix.rows as usize];
    for (&cluster, &importance) in of.iter().zip(&senders.importance) {
        mass[cluster as usize] += f64::from(weight(importance));
    }
    let coarse = senders.counts[0] as usize;
    let mut parent: Vec<u32> = (0..bounce.matrix.rows).collect();
    for parents in senders.parents[..level].iter().rev() {
        parent.iter_mut().for_each(|c| *c = parents[*c as usize]);
    }
    let stored = bounce.matrix;
    let shape = (mass.len(), mass.len());
    Ok(Room {
        name: name.to_owned(),
        k: SparseMatrix::try_new(shape, stored.row_offsets, stored.columns, stored.weights)
            .map_err(|(.., error)| error)?,
        mass,
        parent: (parent, coarse),
    })
}

/// Rooms in a row, doors between neighbours that take a share of each wall's view.
fn row_of_rooms(rooms: usize, each: usize, door: f32) -> Room {
    let n = rooms * each;
    let of_wall = |i: usize| {
        let mut row = Vec::new();
        let room = i / each;
        let doors = [room.checked_sub(1), (room + 1 < rooms).then_some(room + 1)];
        let open = doors.iter().flatten().count() as f32 * door;
        let share = |r: usize| if r == room { 1.0 - open } else { door };
        let mut seen: Vec<usize> = doors.into_iter().flatten().chain([room]).collect();
        seen.sort_unstable();
        for r in seen {
            // Uneven within a room, alike to all of its walls, as in a sphere.
            row.extend((0..each).map(|j| {
                let uneven = 2.0 * (j + 1) as f32 / (each * (each + 1)) as f32;
                ((r * each + j) as u32, share(r) * uneven)
            }));
        }
        row
    };
    let k = build(n, n, |i, row| row.extend(of_wall(i)));
    let mass = (0..n).map(|i| (i % each + 1) as f64).collect();
    let parent = (0..n as u32).map(|i| i / each as u32).collect();
    Room {
        name: format!("{rooms} rooms in a row, doors {}\u{202f}%", 100.0 * door),
        k,
        mass,
        parent: (parent, rooms),
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut rooms = vec![row_of_rooms(8, 40, 0.01)];
    for name in ["furnace_varying", "furnace_box", "two_rooms", "cornell", "atrium"] {
        rooms.push(baked(name)?);
    }
    println!("| operator | clusters | entries a row | largest row sum | ρ | radius of ρK |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for room in &rooms {
        let n = room.k.rows();
        let radius = spectral_radius(&room.k, &vec![0.999; n]);
        println!(
            "| {} | {n} | {:.0} | {:.7} | 0.999 | {:.5} (at most {:.5}) |",
            room.name,
            room.k.nnz() as f64 / n as f64,
            largest_row_sum(&room.k),
            radius.estimate,
            radius.upper,
        );
    }
    println!(
        "\nProducts / error of all light, % / largest error relative to the brightest place, % / to the place itself, %.\n"
    );
    println!("| operator | ρ | series | Anderson | BiCGSTAB | symmetric CG | two levels | GMRES |");
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for room in &rooms {
        for rho in [0.5, 0.9, 0.99, 0.999, 0.9999] {
            let n = room.k.rows();
            let mut s = Stream::new(61, 0, 0);
            let mut emitted: Vec<f64> = (0..n)
                .map(|_| {
                    if s.uniform() < 0.125 {
                        f64::from(s.uniform())
                    } else {
                        0.0
                    }
                })
                .collect();
            emitted[n / 3] = 100.0;
            let b: Vec<Vec3> = emitted.iter().map(|&b| Vec3::splat(b as f32)).collect();
            let albedo = vec![Vec3::splat(rho as f32); n];
            let (exact, _) = solve_double(&room.k, &b, &albedo, None, 1e-9);
            let exact: Vec<f64> = exact.iter().map(|e| e.x).collect();
            let problem = Problem {
                room,
                rho: f64::from(rho as f32),
                emitted,
                products: 0.into(),
            };
            let mut cells = Vec::new();
            for contestant in [neumann, anderson, bicgstab, symmetric, two_levels] {
                problem.products.set(0);
                let x = contestant(&problem);
                cells.push(cell(room, problem.products.get(), &x, &exact));
            }
            let (e, solve) = solve_double(&room.k, &b, &albedo, None, TOLERANCE);
            let e: Vec<f64> = e.iter().map(|e| e.x).collect();
            cells.push(cell(room, solve.iterations, &e, &exact));
            println!("| {} | {rho} | {} |", room.name, cells.join(" | "));
        }
    }
    Ok(())
}

fn cell(room: &Room, products: u32, x: &[f64], exact: &[f64]) -> String {
    let energy = dot(&room.mass, x) / dot(&room.mass, exact) - 1.0;
    let off = |i: usize| (x[i] - exact[i]).abs();
    let worst = (0..x.len()).map(off).fold(0.0, f64::max) / largest(exact);
    let own = (0..x.len())
        .filter(|&i| exact[i] > 0.0)
        .map(|i| off(i) / exact[i])
        .fold(0.0, f64::max);
    let end = if products >= GIVE_UP { " gave up" } else { "" };
    format!(
        "{products}{end} / {:+.3} / {:.3} / {:.2}",
        100.0 * energy,
        100.0 * worst,
        100.0 * own
    )
}
