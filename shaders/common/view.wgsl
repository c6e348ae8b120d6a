// From pixels to rays and back, for a camera or a light seen as one.

#import common::scene::View

// Direction of the ray through `uv` ((0, 0) is the top left corner of the picture, (1, 1) the bottom right), unit length.
fn ray_direction(view: View, uv: vec2f) -> vec3f {
    let ndc = vec2f(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y);
    return normalize(view.forward + view.right * (ndc.x * view.tan_half_x) + view.up * (ndc.y * view.tan_half_y));
}

// Direction through the centre of a pixel.
fn pixel_direction(view: View, pixel: vec2u, size: vec2u) -> vec3f {
    return ray_direction(view, (vec2f(pixel) + 0.5) / vec2f(size));
}

// Where a world position is seen: uv in xy (outside [0, 1]² when beside the picture), distance along `forward` in z (≤ 0: behind).
fn view_uv(view: View, position: vec3f) -> vec3f {
    let v = position - view.origin;
    let z = dot(v, view.forward);
    let ndc = vec2f(dot(v, view.right) / view.tan_half_x, dot(v, view.up) / view.tan_half_y) / select(z, 1.0, z == 0.0);
    return vec3f(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y, z);
}

// Solid angle of a pixel: area on the plane at unit distance times cos³ of the angle to the axis (methods: radiometry). sr
fn pixel_solid_angle(view: View, pixel: vec2u, size: vec2u) -> f32 {
    let cosine = dot(pixel_direction(view, pixel, size), view.forward);
    let side = 2.0 * vec2f(view.tan_half_x, view.tan_half_y) / vec2f(size);
    return side.x * side.y * cosine * cosine * cosine;
}
