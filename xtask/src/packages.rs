//! How each system's package manager installs what is needed.

/// What can be missing on Linux.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// The Vulkan loader and Mesa's software driver.
    Vulkan,
    /// A C++ compiler: FLIP is C++.
    Compiler,
}

/// A package manager.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Manager {
    /// Debian, Ubuntu.
    Apt,
    /// Fedora and its kin.
    Dnf,
    /// openSUSE.
    Zypper,
    /// Arch.
    Pacman,
    /// Alpine.
    Apk,
}

/// May this user install packages?
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Right {
    /// Is root.
    Root,
    /// `sudo` works without a password.
    Sudo,
    /// Neither.
    None,
}

impl Manager {
    const ALL: [Self; 5] = [Self::Apt, Self::Dnf, Self::Zypper, Self::Pacman, Self::Apk];

    /// The manager's program.
    pub fn program(self) -> &'static str {
        match self {
            Self::Apt => "apt-get",
            Self::Dnf => "dnf",
            Self::Zypper => "zypper",
            Self::Pacman => "pacman",
            Self::Apk => "apk",
        }
    }

    /// The first manager whose program is there.
    pub fn choose(has: impl Fn(&str) -> bool) -> Option<Self> {
        Self::ALL.into_iter().find(|m| has(m.program()))
    }

    /// The packages that hold it.
    pub fn packages(self, need: Need) -> &'static [&'static str] {
        match (need, self) {
            (Need::Vulkan, Self::Apt) => &["libvulkan1", "mesa-vulkan-drivers"],
            (Need::Vulkan, Self::Dnf) => &["vulkan-loader", "mesa-vulkan-drivers"],
            (Need::Vulkan, Self::Zypper) => &["libvulkan1", "libvulkan_lvp"],
            (Need::Vulkan, Self::Pacman) => &["vulkan-icd-loader", "vulkan-swrast"],
            (Need::Vulkan, Self::Apk) => &["vulkan-loader", "mesa-vulkan-swrast"],
            (Need::Compiler, Self::Apt | Self::Apk) => &["g++"],
            (Need::Compiler, Self::Dnf | Self::Zypper) => &["gcc-c++"],
            (Need::Compiler, Self::Pacman) => &["gcc"],
        }
    }

    /// The commands that install them, in order, as root.
    pub fn commands(self, need: Need) -> Vec<Vec<&'static str>> {
        let mut commands: Vec<Vec<&'static str>> = match self {
            Self::Apt => {
                vec![
                    vec!["apt-get", "update"],
                    vec!["env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "install", "-y", "--no-install-recommends"],
                ]
            }
            Self::Dnf => vec![vec!["dnf", "install", "-y"]],
            Self::Zypper => vec![vec!["zypper", "--non-interactive", "install"]],
            Self::Pacman => vec![vec!["pacman", "-Sy", "--needed", "--noconfirm"]],
            Self::Apk => vec![vec!["apk", "add"]],
        };
        if let Some(last) = commands.last_mut() {
            last.extend(self.packages(need));
        }
        commands
    }

    /// The commands as run with that right: without a password or not at all.
    pub fn commands_with(self, need: Need, right: Right) -> Vec<Vec<&'static str>> {
        let prefix: &[&'static str] = if right == Right::Sudo { &["sudo", "-n"] } else { &[] };
        self.commands(need).into_iter().map(|c| [prefix, c.as_slice()].concat()).collect()
    }

    /// One line for the user to paste into a terminal.
    pub fn line(self, need: Need, right: Right) -> String {
        let sudo = if right == Right::Root { "" } else { "sudo " };
        let commands: Vec<String> = self.commands(need).iter().map(|c| format!("{sudo}{}", c.join(" "))).collect();
        commands.join(" && ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_manager_at_hand_is_chosen() {
        assert_eq!(Manager::choose(|p| p == "dnf"), Some(Manager::Dnf));
        assert_eq!(Manager::choose(|p| p == "apt-get" || p == "dnf"), Some(Manager::Apt));
        assert_eq!(Manager::choose(|_| false), None);
    }

    #[test]
    fn root_runs_apt_as_it_is() {
        assert_eq!(
            Manager::Apt.line(Need::Vulkan, Right::Root),
            "apt-get update && env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends libvulkan1 mesa-vulkan-drivers"
        );
    }

    #[test]
    fn sudo_is_put_before_every_command_and_never_asks() {
        let commands = Manager::Apt.commands_with(Need::Compiler, Right::Sudo);
        assert_eq!(commands.len(), 2);
        assert!(commands.iter().all(|c| c.starts_with(&["sudo", "-n"])));
    }

    #[test]
    fn the_line_for_the_user_has_sudo_unless_they_are_root() {
        for manager in Manager::ALL {
            for need in [Need::Vulkan, Need::Compiler] {
                assert!(manager.line(need, Right::None).split(" && ").all(|c| c.starts_with("sudo ")), "{manager:?}");
                assert!(!manager.line(need, Right::Root).contains("sudo"), "{manager:?}");
                assert!(manager.packages(need).iter().all(|p| manager.line(need, Right::None).contains(p)), "{manager:?}");
            }
        }
    }
}
