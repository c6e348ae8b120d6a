//! Whether this machine has a usable Vulkan driver, found out without building or loading anything.
//!
//! Asking the driver itself would need a build of manylight, minutes before the first line of output on a fresh machine, or a Vulkan binding in this
//! program. Instead this reads what the Vulkan loader reads: the loader must be there (`libvulkan.so.1`), and a driver manifest (a JSON file in the
//! loader's search path, or named by `VK_DRIVER_FILES` or `VK_ICD_FILENAMES`) must name a library that exists. A driver for hardware counts only if some GPU
//! device node exists, because distributions install those manifests on every machine. When this guess is wrong, `manylight` itself ends with
//! exit code 3, and `cargo xtask setup --software` installs the software driver regardless.

use std::path::{Path, PathBuf};

use crate::{json::Value, shell::Shell};

/// A driver manifest.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Driver {
    /// The JSON file.
    pub manifest: PathBuf,
    /// `library_path` in it.
    pub library: String,
    /// Whether that library exists.
    pub present: bool,
}

impl Driver {
    /// Whether it draws on the CPU (Mesa's lavapipe, SwiftShader).
    pub fn is_software(&self) -> bool {
        let library = self.library.to_ascii_lowercase();
        ["lvp", "lavapipe", "swiftshader"].iter().any(|name| library.contains(name))
    }
}

/// What was found on the machine.
#[derive(Debug, Clone, Default)]
pub struct Found {
    /// The Vulkan loader.
    pub loader: bool,
    /// Driver manifests.
    pub drivers: Vec<Driver>,
    /// Device nodes of GPUs (`/dev/dri/renderD128`, `/dev/nvidiactl`, `/dev/dxg`).
    pub devices: Vec<String>,
}

/// A judgement with its reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// There is a driver that should work.
    Usable(String),
    /// There is none.
    Missing(String),
}

impl Found {
    /// Whether a driver can be expected to work; with `software_only`, whether a software driver can.
    pub fn verdict(&self, software_only: bool) -> Verdict {
        if !self.loader {
            return Verdict::Missing("the Vulkan loader (libvulkan.so.1) is not installed".to_owned());
        }
        let present: Vec<&Driver> = self.drivers.iter().filter(|d| d.present).collect();
        if !software_only && let (Some(driver), Some(device)) = (present.iter().find(|d| !d.is_software()), self.devices.first()) {
            return Verdict::Usable(format!("driver {} and device {device}", driver.manifest.display()));
        }
        if let Some(driver) = present.iter().find(|d| d.is_software()) {
            return Verdict::Usable(format!("software driver {}", driver.manifest.display()));
        }
        Verdict::Missing(match present.first() {
            _ if software_only => "no software Vulkan driver is installed".to_owned(),
            Some(driver) => format!("{} is for hardware, but no GPU device is to be seen", driver.manifest.display()),
            None => "no Vulkan driver is installed".to_owned(),
        })
    }

    /// Looks at this machine.
    pub fn on_this_machine(shell: &Shell) -> Self {
        let libraries = Libraries::known(shell);
        let drivers = manifests()
            .into_iter()
            .filter_map(|manifest| {
                let library = Value::parse(&std::fs::read_to_string(&manifest).ok()?)?.find_text("library_path")?.to_owned();
                let present = libraries.has(&library, manifest.parent().unwrap_or(Path::new(".")));
                Some(Driver { manifest, library, present })
            })
            .collect();
        Self { loader: libraries.has("libvulkan.so.1", Path::new(".")), drivers, devices: devices() }
    }
}

/// Shared libraries that the dynamic linker finds by name.
struct Libraries {
    cache: Vec<String>,
    folders: Vec<PathBuf>,
}

impl Libraries {
    fn known(shell: &Shell) -> Self {
        // Debian keeps ldconfig out of the path of ordinary users.
        let cache = ["ldconfig", "/sbin/ldconfig", "/usr/sbin/ldconfig"]
            .iter()
            .find_map(|program| shell.quiet(&[program, "-p"]).filter(|f| f.success))
            .map(|f| cached_libraries(&f.stdout))
            .unwrap_or_default();
        let mut folders: Vec<PathBuf> = path_list("LD_LIBRARY_PATH");
        folders.extend(["/usr/lib", "/usr/lib64", "/lib", "/lib64", "/usr/local/lib"].map(PathBuf::from));
        Self { cache, folders }
    }

    /// `name` is a plain name, an absolute path or a path relative to the manifest's folder, as the loader reads it.
    fn has(&self, name: &str, folder: &Path) -> bool {
        if name.contains('/') {
            return folder.join(name).exists();
        }
        self.cache.iter().any(|known| known == name) || self.folders.iter().any(|f| f.join(name).exists())
    }
}

/// Names in the output of `ldconfig -p`.
fn cached_libraries(listing: &str) -> Vec<String> {
    listing.lines().filter(|l| l.contains("=>")).filter_map(|l| l.split_whitespace().next()).map(str::to_owned).collect()
}

/// Driver manifests in the loader's order. `VK_DRIVER_FILES` (once `VK_ICD_FILENAMES`) replaces the search; each entry is a file or a folder.
fn manifests() -> Vec<PathBuf> {
    let named = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(path_list).into_iter().find(|list| !list.is_empty());
    let replaced = named.is_some();
    let mut places = named.unwrap_or_default();
    if !replaced {
        places.extend(path_list("VK_ADD_DRIVER_FILES"));
        places.extend(search_folders(&|name| std::env::var(name).ok().filter(|v| !v.is_empty())));
    }
    places.iter().flat_map(|place| manifests_in(place)).collect()
}

fn manifests_in(place: &Path) -> Vec<PathBuf> {
    if place.is_file() {
        return vec![place.to_owned()];
    }
    let entries = std::fs::read_dir(place).into_iter().flatten().flatten().map(|e| e.path());
    let mut files: Vec<PathBuf> = entries.filter(|p| p.extension().is_some_and(|e| e == "json")).collect();
    files.sort();
    files
}

/// The loader's default search path on Linux, given the environment.
fn search_folders(environment: &dyn Fn(&str) -> Option<String>) -> Vec<PathBuf> {
    let home = environment("HOME");
    let in_home = |name: &str, default: &str| environment(name).or_else(|| home.as_ref().map(|h| format!("{h}/{default}")));
    let mut bases: Vec<String> = Vec::new();
    bases.extend(in_home("XDG_CONFIG_HOME", ".config"));
    bases.extend(environment("XDG_CONFIG_DIRS").unwrap_or_else(|| "/etc/xdg".to_owned()).split(':').map(str::to_owned));
    bases.extend(["/usr/local/etc".to_owned(), "/etc".to_owned()]);
    bases.extend(in_home("XDG_DATA_HOME", ".local/share"));
    bases.extend(environment("XDG_DATA_DIRS").unwrap_or_else(|| "/usr/local/share:/usr/share".to_owned()).split(':').map(str::to_owned));
    bases.into_iter().filter(|b| !b.is_empty()).map(|base| Path::new(&base).join("vulkan/icd.d")).collect()
}

fn path_list(variable: &str) -> Vec<PathBuf> {
    std::env::var_os(variable).map(|v| std::env::split_paths(&v).filter(|p| !p.as_os_str().is_empty()).collect()).unwrap_or_default()
}

fn devices() -> Vec<String> {
    let mut found: Vec<String> = ["/dev/nvidiactl", "/dev/dxg", "/dev/mali0", "/dev/kgsl-3d0"]
        .iter()
        .filter(|p| Path::new(p).exists())
        .map(|p| (*p).to_owned())
        .collect();
    let entries = std::fs::read_dir("/dev/dri").into_iter().flatten().flatten().map(|e| e.path());
    found.extend(
        entries.filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("renderD"))).map(|p| p.display().to_string()),
    );
    found.sort();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn driver(name: &str, present: bool) -> Driver {
        Driver {
            manifest: PathBuf::from(format!("/usr/share/vulkan/icd.d/{name}_icd.json")),
            library: format!("/usr/lib/libvulkan_{name}.so"),
            present,
        }
    }

    fn found(drivers: &[Driver], devices: &[&str]) -> Found {
        Found { loader: true, drivers: drivers.to_vec(), devices: devices.iter().map(|d| (*d).to_owned()).collect() }
    }

    fn reason(verdict: Verdict) -> Result<String, String> {
        match verdict {
            Verdict::Usable(reason) => Ok(reason),
            Verdict::Missing(reason) => Err(reason),
        }
    }

    #[test]
    fn without_the_loader_no_driver_helps() {
        let machine = Found { loader: false, ..found(&[driver("lvp", true)], &[]) };
        assert!(reason(machine.verdict(false)).unwrap_err().contains("libvulkan.so.1"));
    }

    #[test]
    fn a_hardware_driver_needs_a_device() {
        assert!(reason(found(&[driver("radeon", true)], &[]).verdict(false)).unwrap_err().contains("no GPU device"));
        assert!(reason(found(&[driver("radeon", true)], &["/dev/dri/renderD128"]).verdict(false)).unwrap().contains("renderD128"));
    }

    #[test]
    fn a_software_driver_needs_nothing_else() {
        assert!(reason(found(&[driver("intel", true), driver("lvp", true)], &[]).verdict(false)).unwrap().contains("lvp_icd.json"));
    }

    #[test]
    fn a_manifest_without_its_library_does_not_count() {
        assert!(reason(found(&[driver("lvp", false)], &[]).verdict(false)).unwrap_err().contains("no Vulkan driver"));
    }

    #[test]
    fn software_only_ignores_hardware() {
        let machine = found(&[driver("radeon", true)], &["/dev/dri/renderD128"]);
        assert!(reason(machine.verdict(true)).unwrap_err().contains("software"));
    }

    #[test]
    fn ldconfig_is_read() {
        let listing = "2 libs found in cache `/etc/ld.so.cache'\n\tlibvulkan.so.1 (libc6,x86-64) => /lib/x86_64-linux-gnu/libvulkan.so.1\n\tlibc.so.6 (libc6) => /lib/libc.so.6\n";
        assert_eq!(cached_libraries(listing), ["libvulkan.so.1", "libc.so.6"]);
    }

    #[test]
    fn the_search_path_is_the_loaders() {
        let folders = search_folders(&|name| (name == "HOME").then(|| "/home/ada".to_owned()));
        let folders: Vec<String> = folders.iter().map(|f| f.display().to_string()).collect();
        assert_eq!(folders.first().map(String::as_str), Some("/home/ada/.config/vulkan/icd.d"));
        assert!(folders.contains(&"/etc/vulkan/icd.d".to_owned()));
        assert!(folders.contains(&"/usr/share/vulkan/icd.d".to_owned()));
        let folders = search_folders(&|name| (name == "XDG_DATA_DIRS").then(|| "/opt/share".to_owned()));
        assert!(folders.contains(&PathBuf::from("/opt/share/vulkan/icd.d")));
        assert!(!folders.contains(&PathBuf::from("/usr/share/vulkan/icd.d")));
    }
}
