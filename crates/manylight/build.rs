//! Rebuilds the program when a file that it embeds changes.

fn main() {
    for folder in ["shaders", "pipelines", "assets"] {
        println!("cargo::rerun-if-changed={folder}");
    }
}
