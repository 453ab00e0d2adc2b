//! An emulated device of the kernel's: a folder with a file for each attribute.

use super::device::Device;
use super::{Service, SharedPlant};
use instruments::{FrameId, FrameKind};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

/// How often the attributes are written anew.
const TURN: Duration = Duration::from_millis(2);

/// A running emulator; dropping it stops it, and its folder goes.
pub struct SysfsFolder {
    path: PathBuf,
    thread: Service,
}

impl SysfsFolder {
    /// Serves an instrument's attributes in a folder of its own among the temporary files.
    ///
    /// # Errors
    /// Where the folder cannot be made.
    pub fn start(mut device: Device, plant: SharedPlant) -> io::Result<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("muprime-sysfs-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir(&path)?;
        write(&mut device, &plant, &path)?;
        let folder = path.clone();
        let turn = move |_: &_| {
            if let Err(error) = write(&mut device, &plant, &folder) {
                tracing::debug!(%error, "the emulated attributes");
            }
            std::thread::sleep(TURN);
        };
        Ok(Self { path, thread: Service::start("sysfs-emulator", turn)? })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for SysfsFolder {
    fn drop(&mut self) {
        self.thread.end();
        let _ = std::fs::remove_dir_all(&self.path);
    }
}

/// Writes every attribute, each whole.
fn write(device: &mut Device, plant: &SharedPlant, folder: &Path) -> io::Result<()> {
    let (mut plant, now) = plant.now();
    for index in 0..device.profile().frames().len() {
        let FrameKind::Query(query) = device.profile().frames()[index].kind else { continue };
        let bytes = device.frame(FrameId(index), &mut *plant, now);
        let line = device.profile().frames()[index].write_line(&bytes, 1.0).unwrap_or_default();
        let name = &device.profile().description.query[query].send;
        let whole = folder.join(format!(".{name}"));
        std::fs::write(&whole, line + "\n")?;
        std::fs::rename(&whole, folder.join(name))?;
    }
    Ok(())
}
