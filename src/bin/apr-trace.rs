//! `apr-trace scene.json out.exr`
fn main() {}
