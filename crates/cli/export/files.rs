//! The files that `export` writes, all of them or none: numpy's .npy (version 1.0), binary little-endian PLY 1.0,
//! Matrix Market's coordinate format (.mtx), and Radiance's float matrices (.rmx, as `rmtxop` and `dctimestep` read them).

use crate::guard::Guard;
use crate::kinds::Kind;
use crate::output;
use crate::signals;
use anyhow::{Context, Result, bail};
use relight_scene::image::write_atomically_with;
use relight_transport::sparse::{SparseMatrix, row};
use serde::Serialize;
use sprs::io::write_matrix_market_to_bufwrite;
use std::error::Error;
use std::fmt::{self, Display};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Where files go, and what has been written so far: into a folder of its own, from which [`Folder::finish`] takes it.
pub struct Folder<'a> {
    path: PathBuf,
    unfinished: TempDir,
    guard: &'a Guard,
    /// One per file.
    pub written: Vec<Written>,
}

/// A file that was written.
#[derive(Serialize)]
pub struct Written {
    pub file: String,
    /// Of arrays and matrices their sizes, the slowest index first.
    pub shape: Vec<usize>,
    pub unit: String,
}

/// One value per element of a PLY.
pub enum Column<'a> {
    /// Three floats.
    Vectors(&'a [[f32; 3]]),
    /// Three doubles.
    Doubles(&'a [[f64; 3]]),
    /// One byte.
    Bytes(&'a [u8]),
}

/// Places in a scene, metres.
pub enum Positions<'a> {
    /// As the asset has them.
    Here(&'a [[f32; 3]]),
    /// In coordinates that 32-bit numbers are too coarse for.
    Moved(Vec<[f64; 3]>),
}

impl Positions<'_> {
    /// As properties of a PLY.
    pub fn column(&self) -> Column<'_> {
        match self {
            Positions::Here(values) => Column::Vectors(values),
            Positions::Moved(values) => Column::Doubles(values),
        }
    }
}

impl Column<'_> {
    fn len(&self) -> usize {
        match self {
            Column::Vectors(values) => values.len(),
            Column::Doubles(values) => values.len(),
            Column::Bytes(values) => values.len(),
        }
    }
}

fn write_all_le<const N: usize>(
    out: &mut dyn Write,
    values: impl Iterator<Item = [u8; N]>,
) -> io::Result<()> {
    for value in values {
        out.write_all(&value)?;
    }
    Ok(())
}

/// A file that could not be written, in words that name it.
#[derive(Debug)]
pub struct Unwritten(String);

impl Display for Unwritten {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Error for Unwritten {}

/// A file of gibibytes that no signal has to wait for.
struct Stopping<'a>(&'a mut dyn Write);

impl Write for Stopping<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match signals::stopped() {
            true => Err(io::Error::other("stopped")),
            false => self.0.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl<'a> Folder<'a> {
    /// Files go to `path`, which must exist, as far as `guard` lets them.
    ///
    /// # Errors
    /// Nothing can be written there.
    pub fn new(path: &Path, guard: &'a Guard) -> Result<Self> {
        Ok(Folder {
            path: path.to_owned(),
            unfinished: output::scratch_in(path)?,
            guard,
            written: Vec::new(),
        })
    }

    /// Puts all files where they belong.
    ///
    /// # Errors
    /// The system refuses.
    pub fn finish(&self) -> Result<()> {
        let _whole = signals::whole();
        for Written { file, .. } in &self.written {
            let target = self.path.join(file);
            std::fs::rename(self.unfinished.path().join(file), &target)
                .with_context(|| format!("{}: cannot be written", target.display()))?;
        }
        Ok(())
    }

    fn write(
        &mut self,
        file: String,
        shape: &[usize],
        unit: &str,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<()> {
        if signals::stopped() {
            bail!("stopped");
        }
        let target = self.path.join(&file);
        self.guard.check(&target, kind_of(&file))?;
        if target.exists() && !target.is_file() {
            bail!("{}: is no file; a result would replace it", target.display());
        }
        let _whole = signals::whole();
        // Whatever goes wrong concerns the target.
        write_atomically_with(&self.unfinished.path().join(&file), |out| {
            write(&mut Stopping(out))
        })
        .map_err(|error| {
            error
                .source()
                .map_or_else(|| error.to_string(), ToString::to_string)
        })
        .map_err(|error| Unwritten(format!("{}: cannot be written: {error}", target.display())))?;
        self.written.push(Written {
            file,
            shape: shape.to_vec(),
            unit: unit.to_owned(),
        });
        Ok(())
    }

    fn npy(
        &mut self,
        name: &str,
        unit: &str,
        kind: &str,
        shape: &[usize],
        data: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<()> {
        let dimensions: String = shape.iter().map(|n| format!("{n},")).collect();
        let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({dimensions}), }}");
        // Magic, version and length take ten bytes; data starts at a multiple of 64, after a line end.
        while !(10 + header.len() + 1).is_multiple_of(64) {
            header.push(' ');
        }
        header.push('\n');
        self.write(format!("{name}.npy"), shape, unit, |out| {
            out.write_all(b"\x93NUMPY\x01\x00")?;
            out.write_all(&(header.len() as u16).to_le_bytes())?;
            out.write_all(header.as_bytes())?;
            data(out)
        })
    }

    /// An n × 3 array of f32.
    pub fn vectors(&mut self, name: &str, unit: &str, values: &[[f32; 3]]) -> Result<()> {
        let bytes = values.as_flattened().iter().map(|v| v.to_le_bytes());
        self.npy(name, unit, "<f4", &[values.len(), 3], |out| {
            write_all_le(out, bytes)
        })
    }

    /// Several n × 3 arrays of f32, one after the other, as one.
    pub fn vectors_of_several(
        &mut self,
        name: &str,
        unit: &str,
        n: usize,
        arrays: &[Vec<[f32; 3]>],
    ) -> Result<()> {
        let values = arrays.iter().flat_map(|array| array.as_flattened());
        self.npy(name, unit, "<f4", &[arrays.len(), n, 3], |out| {
            write_all_le(out, values.map(|v| v.to_le_bytes()))
        })
    }

    /// An array of f32 of several indices.
    pub fn array(&mut self, name: &str, unit: &str, shape: &[usize], values: &[f32]) -> Result<()> {
        let bytes = values.iter().map(|v| v.to_le_bytes());
        self.npy(name, unit, "<f4", shape, |out| write_all_le(out, bytes))
    }

    /// A texture or a scene, whole.
    pub fn texture(&mut self, file: &str, shape: &[usize], unit: &str, bytes: &[u8]) -> Result<()> {
        self.write(file.to_owned(), shape, unit, |out| out.write_all(bytes))
    }

    /// A text.
    pub fn text(&mut self, file: &str, text: &str) -> Result<()> {
        self.write(file.to_owned(), &[], "", |out| out.write_all(text.as_bytes()))
    }

    /// An n × 3 array of f32, or of f64.
    pub fn positions(&mut self, name: &str, positions: &Positions) -> Result<()> {
        match positions {
            Positions::Here(values) => self.vectors(name, "m", values),
            Positions::Moved(values) => {
                let bytes = values.as_flattened().iter().map(|v| v.to_le_bytes());
                self.npy(name, "m", "<f8", &[values.len(), 3], |out| {
                    write_all_le(out, bytes)
                })
            }
        }
    }

    /// An array of f32.
    pub fn floats(&mut self, name: &str, unit: &str, values: &[f32]) -> Result<()> {
        let bytes = values.iter().map(|v| v.to_le_bytes());
        self.npy(name, unit, "<f4", &[values.len()], |out| write_all_le(out, bytes))
    }

    /// An array of u32.
    pub fn numbers(&mut self, name: &str, unit: &str, values: &[u32]) -> Result<()> {
        let bytes = values.iter().map(|v| v.to_le_bytes());
        self.npy(name, unit, "<u4", &[values.len()], |out| write_all_le(out, bytes))
    }

    /// An array of u8.
    pub fn bytes(&mut self, name: &str, unit: &str, values: &[u8]) -> Result<()> {
        self.npy(name, unit, "|u1", &[values.len()], |out| out.write_all(values))
    }

    /// Vertices with the named properties.
    pub fn ply(&mut self, name: &str, columns: &[([&str; 3], Column<'_>)]) -> Result<()> {
        let count = columns.first().map_or(0, |c| c.1.len());
        let mut header = format!(
            "ply\nformat binary_little_endian 1.0\ncomment relight export, metres, +Y up\nelement vertex {count}\n"
        );
        for (names, column) in columns {
            match column {
                Column::Vectors(_) => names
                    .iter()
                    .for_each(|n| header += &format!("property float {n}\n")),
                Column::Doubles(_) => names
                    .iter()
                    .for_each(|n| header += &format!("property double {n}\n")),
                Column::Bytes(_) => header += &format!("property uchar {}\n", names[0]),
            }
        }
        header += "end_header\n";
        self.write(format!("{name}.ply"), &[count], "m", |out| {
            out.write_all(header.as_bytes())?;
            for i in 0..count {
                for (_, column) in columns {
                    match column {
                        Column::Vectors(values) => {
                            write_all_le(out, values[i].iter().map(|v| v.to_le_bytes()))?
                        }
                        Column::Doubles(values) => {
                            write_all_le(out, values[i].iter().map(|v| v.to_le_bytes()))?
                        }
                        Column::Bytes(values) => out.write_all(&values[i..=i])?,
                    }
                }
            }
            Ok(())
        })
    }

    /// A sparse matrix in Matrix Market's format: row, column (both from 1) and value of each entry.
    pub fn market(&mut self, name: &str, unit: &str, matrix: &SparseMatrix) -> Result<()> {
        self.write(
            format!("{name}.mtx"),
            &[matrix.rows(), matrix.cols()],
            unit,
            |out| write_matrix_market_to_bufwrite(out, matrix),
        )
    }

    /// A matrix as Radiance has it, dense: `components` rows of `matrix` after each other are the components of one row.
    /// `what` is said in the header.
    pub fn radiance(
        &mut self,
        name: &str,
        what: &str,
        components: usize,
        matrix: &SparseMatrix,
    ) -> Result<()> {
        let (rows, columns) = (matrix.rows() / components, matrix.cols());
        let header = format!(
            "#?RADIANCE\nrelight export: {what}\nNROWS={rows}\nNCOLS={columns}\nNCOMP={components}\nBigEndian=0\nFORMAT=float\n\n"
        );
        let shape = [rows, columns, components];
        self.write(format!("{name}.rmx"), &shape, "W/m² per W/m²", |out| {
            out.write_all(header.as_bytes())?;
            let mut dense = vec![0.0f32; columns * components];
            for i in 0..rows {
                dense.fill(0.0);
                for component in 0..components {
                    for (column, weight) in row(matrix, i * components + component) {
                        dense[column as usize * components + component] = weight;
                    }
                }
                write_all_le(out, dense.iter().map(|v| v.to_le_bytes()))?;
            }
            Ok(())
        })
    }
}

/// What a file of this name is.
fn kind_of(file: &str) -> Kind {
    match file.rsplit('.').next() {
        Some("npy") => Kind::Npy,
        Some("ply") => Kind::Ply,
        Some("mtx") => Kind::Market,
        Some("txt") => Kind::ExportPage,
        Some("ktx2") => Kind::Ktx2,
        Some("exr") => Kind::Exr,
        Some("glb") => Kind::Scene,
        _ => Kind::RadianceMatrix,
    }
}

/// Whether something of so many values of so many bytes each is within `--matrix-limit`; `instead` of it one can have other
/// parts.
///
/// # Errors
/// It is not; says its size.
pub fn check_size(name: &str, shape: &[usize], bytes_each: u64, limit: u64, instead: &str) -> Result<()> {
    let bytes = (shape.iter()).try_fold(bytes_each, |product, &n| product.checked_mul(n as u64));
    if bytes.is_some_and(|bytes| bytes <= limit) {
        return Ok(());
    }
    let shape: Vec<String> = shape.iter().map(usize::to_string).collect();
    bail!(
        "{name} takes {} bytes ({} values of {bytes_each}), more than --matrix-limit ({limit}); raise it, or take --what \
         {instead}, which is sparse",
        bytes.map_or("more than 2^64".into(), |bytes| bytes.to_string()),
        shape.join(" × ")
    );
}
