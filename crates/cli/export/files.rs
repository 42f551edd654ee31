//! The files that `export` writes, each whole or not at all: numpy's .npy (version 1.0), binary little-endian PLY 1.0,
//! and Radiance's float matrices (as `rmtxop` and `dctimestep` read them).

use anyhow::{Result, bail};
use relight_scene::image::write_atomically_with;
use serde_json::{Value, json};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Where files go, and what is there so far.
pub struct Folder {
    path: PathBuf,
    /// One object per file: name, shape, unit.
    pub written: Vec<Value>,
}

/// One value per element of a PLY.
pub enum Column<'a> {
    /// Three floats.
    Vectors(&'a [[f32; 3]]),
    /// One byte.
    Bytes(&'a [u8]),
}

impl Column<'_> {
    fn len(&self) -> usize {
        match self {
            Column::Vectors(values) => values.len(),
            Column::Bytes(values) => values.len(),
        }
    }
}

/// A sparse matrix to be written densely. Compressed rows: the entries of row i stand at
/// `row_offsets[i]..row_offsets[i + 1]`.
pub struct Matrix<'a> {
    /// Said in the header.
    pub what: &'a str,
    /// Number of columns.
    pub columns: usize,
    /// One more than rows.
    pub row_offsets: &'a [u32],
    /// Column of each entry.
    pub column: &'a [u32],
    /// Components of each entry, as many as this is longer than `column`.
    pub entries: &'a [f32],
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

impl Folder {
    /// Files go to `path`, which must exist.
    pub fn new(path: &Path) -> Self {
        Folder {
            path: path.to_owned(),
            written: Vec::new(),
        }
    }

    fn write(
        &mut self,
        file: String,
        shape: &[usize],
        unit: &str,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<()> {
        write_atomically_with(&self.path.join(&file), write)?;
        self.written
            .push(json!({ "file": file, "shape": shape, "unit": unit }));
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
                        Column::Bytes(values) => out.write_all(&values[i..=i])?,
                    }
                }
            }
            Ok(())
        })
    }

    /// A dense matrix of at most `limit` bytes; absent entries are 0.
    pub fn matrix(&mut self, name: &str, limit: u64, matrix: &Matrix<'_>) -> Result<()> {
        let rows = matrix.row_offsets.len().saturating_sub(1);
        // A matrix without entries has as many components as it will ever have.
        let components = matrix.entries.len() / matrix.column.len().max(1);
        let components = components.max(1);
        let bytes = [rows, matrix.columns, components, 4]
            .iter()
            .try_fold(1u64, |product, &n| product.checked_mul(n as u64));
        if bytes.is_none_or(|bytes| bytes > limit) {
            let size = bytes.map_or("more than 2^64".into(), |bytes| bytes.to_string());
            bail!(
                "{name}.mtx would take {size} bytes as a dense matrix of {rows} × {} × {components} floats, more than \
                 --matrix-limit ({limit}); raise it, or take --what links, which is sparse",
                matrix.columns
            );
        }
        let header = format!(
            "#?RADIANCE\nrelight export: {}\nNROWS={rows}\nNCOLS={}\nNCOMP={components}\nBigEndian=0\nFORMAT=float\n\n",
            matrix.what, matrix.columns
        );
        let shape = [rows, matrix.columns, components];
        self.write(format!("{name}.mtx"), &shape, "W/m² per W/m²", |out| {
            out.write_all(header.as_bytes())?;
            let mut dense = vec![0.0f32; matrix.columns * components];
            for row in matrix.row_offsets.windows(2) {
                dense.fill(0.0);
                for entry in row[0] as usize..row[1] as usize {
                    let at = matrix.column[entry] as usize * components;
                    let from = &matrix.entries[entry * components..(entry + 1) * components];
                    dense[at..at + components].copy_from_slice(from);
                }
                write_all_le(out, dense.iter().map(|v| v.to_le_bytes()))?;
            }
            Ok(())
        })
    }
}
