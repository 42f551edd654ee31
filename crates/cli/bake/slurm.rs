//! Job scripts for Slurm: an array of units, and the merge after it.

use crate::failure::Failure;
use crate::signals;
use anyhow::Context;
use relight_format::unit::write_durably;
use std::path::Path;

/// Its scripts, in DIR/slurm.
pub const NAMES: [&str; 3] = ["unit.sh", "merge.sh", "submit.sh"];

/// Writes DIR/slurm/{unit,merge,submit}.sh. A job that is requeued begins its unit again and finds what it had finished.
///
/// # Errors
/// A script cannot be written, or a path is not UTF-8.
pub fn write(folder: &Path, units: usize) -> Result<(), Failure> {
    let program = std::env::current_exe().context("cannot find the program itself")?;
    let (program, plan) = (quoted(&program)?, quoted(folder)?);
    let _whole = signals::whole();
    let scripts = folder.join("slurm");
    let place = quoted(&scripts)?;
    std::fs::create_dir_all(&scripts).with_context(|| format!("{}: cannot be made", scripts.display()))?;
    let unit = format!(
        "#!/bin/sh
#SBATCH --job-name=relight-units
#SBATCH --array=1-{units}
#SBATCH --requeue
#SBATCH --open-mode=append
# Without the option rayon takes all cores that the job may use.
exec {program} bake ${{SLURM_CPUS_PER_TASK:+--threads \"$SLURM_CPUS_PER_TASK\"}} \\
    --unit \"$SLURM_ARRAY_TASK_ID/{units}\" {plan}
"
    );
    let merge = format!(
        "#!/bin/sh
#SBATCH --job-name=relight-merge
#SBATCH --requeue
#SBATCH --open-mode=append
exec {program} bake ${{SLURM_CPUS_PER_TASK:+--threads \"$SLURM_CPUS_PER_TASK\"}} --merge {plan}
"
    );
    let submit = format!(
        "#!/bin/sh
# Submits all units, and the merge once they have all ended well. Options of sbatch may follow, such as
# --partition=long --cpus-per-task=16. Prints the number of the merge's job.
set -eu
cd {place}
units=$(sbatch --parsable --output=unit-%a.log \"$@\" unit.sh)
exec sbatch --parsable --output=merge.log --dependency=afterok:\"${{units%%;*}}\" --kill-on-invalid-dep=yes \"$@\" merge.sh
"
    );
    for (name, text) in NAMES.into_iter().zip([unit, merge, submit]) {
        let path = scripts.join(name);
        write_durably(&path, text.as_bytes())
            .and_then(|()| executable(&path))
            .with_context(|| format!("{}: cannot be written", path.display()))?;
    }
    Ok(())
}

#[cfg(unix)]
fn executable(path: &Path) -> std::io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755))
}

#[cfg(not(unix))]
fn executable(_: &Path) -> std::io::Result<()> {
    Ok(())
}

/// A path as one word of a shell.
fn quoted(path: &Path) -> Result<String, Failure> {
    let text = path
        .to_str()
        .with_context(|| format!("{}: its name is not UTF-8", path.display()))?;
    Ok(format!("'{}'", text.replace('\'', r"'\''")))
}
