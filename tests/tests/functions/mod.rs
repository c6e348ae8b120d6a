//! Every function of `shaders/common`, called on the GPU with thousands of arguments and compared with a twin in 64 bits.

mod directions;
mod harness;
mod inputs;
mod random;
