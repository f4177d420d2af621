//! The one table of a scene file's keys: the reader and the schema both follow it.

use super::quantity::Dimension::{self, Angle, Length, None as Pure, Speed, Stops, Time};

/// A key of a table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Key {
    pub(crate) name: &'static str,
    pub(crate) shape: Shape,
    pub(crate) presence: Presence,
    /// What it means: one sentence.
    pub(crate) about: &'static str,
}

/// What a key's value looks like.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// Any text.
    Text,
    /// true or false.
    Flag,
    /// A whole number from 0 on.
    Count,
    /// A number of that dimension.
    Number(Dimension),
    /// A number, or one over time.
    Curve(Dimension),
    /// A low and a high end.
    Range(Dimension),
    /// `[x, y, z]`, metres.
    Place,
    /// `[r, g, b]`, linear BT.709, or `"#rrggbb"`, sRGB.
    Colour,
    /// `"800x600"` or `[800, 600]`.
    Resolution,
    /// `[x0, y0, x1, y1]`, pixels.
    Crop,
    /// A field expression.
    Field,
    /// The path of a file, relative to the scene's folder.
    File,
    /// A table with these keys.
    Table(&'static [Key]),
    /// A list of tables with these keys.
    List(&'static [Key]),
    /// Curves by name.
    Curves,
}

/// Whether a key must be there.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Presence {
    /// It must.
    Required,
    /// It need not.
    Optional,
    /// Where it is absent this stands for it, written as in the file.
    Default(&'static str),
}

use Presence::{Default, Optional, Required};

const fn key(name: &'static str, shape: Shape, presence: Presence, about: &'static str) -> Key {
    Key {
        name,
        shape,
        presence,
        about,
    }
}

/// The whole file.
pub(crate) const SCENE: &[Key] = &[
    key(
        "name",
        Shape::Text,
        Optional,
        "What the scene is called and how its frames' names begin; the file's name if absent.",
    ),
    key(
        "key",
        Shape::Count,
        Default("1"),
        "From which all random numbers of the sampling start.",
    ),
    key("film", Shape::Table(FILM), Optional, "What is recorded."),
    key(
        "sampling",
        Shape::Table(SAMPLING),
        Optional,
        "How densely it is sampled.",
    ),
    key(
        "camera",
        Shape::Table(CAMERA),
        Required,
        "From where it is seen; one of fixed, spline, great_circle.",
    ),
    key(
        "surface",
        Shape::Table(SURFACE),
        Required,
        "What is seen; on one of plane, sphere.",
    ),
    key(
        "curves",
        Shape::Curves,
        Optional,
        "Numbers over time that field expressions use by name, in base units (metres, radians, seconds).",
    ),
    key(
        "material",
        Shape::Table(MATERIAL),
        Optional,
        "What the surface is made of.",
    ),
    key("sun", Shape::Table(SUN), Optional, "The light."),
    key(
        "sky",
        Shape::Table(SKY),
        Optional,
        "The background and the air; one of plain, air.",
    ),
];

pub(crate) const FILM: &[Key] = &[
    key(
        "resolution",
        Shape::Resolution,
        Default("\"800x600\""),
        "Pixels of the whole image, width x height.",
    ),
    key(
        "crop",
        Shape::Crop,
        Optional,
        "The part of the image that is rendered and stored, [x0, y0, x1, y1], ends not included; everything if absent.",
    ),
    key(
        "images",
        Shape::Count,
        Default("1"),
        "How many images the scene has; they are numbered from 0.",
    ),
    key(
        "fps",
        Shape::Number(Pure),
        Default("25"),
        "Images per second; image n is taken from n/fps on.",
    ),
    key(
        "shutter",
        Shape::Number(Time),
        Default("0"),
        "How long the shutter stays open, less than 1/fps; 0 takes an instant.",
    ),
    key(
        "exposure",
        Shape::Number(Stops),
        Default("0"),
        "Stops added before the view transform of PNG and PPM; EXR stays linear and is not changed.",
    ),
];

pub(crate) const SAMPLING: &[Key] = &[
    key(
        "rays",
        Shape::Count,
        Default("4"),
        "N of the N x N rays of a pixel.",
    ),
    key(
        "filter_order",
        Shape::Count,
        Default("4"),
        "Order of the B-spline filter, 4 is cubic; 0 samples pixel centres alone.",
    ),
];

pub(crate) const CAMERA: &[Key] = &[
    key(
        "angle",
        Shape::Curve(Angle),
        Optional,
        "Angle of view between the left and right edges; 60 deg if neither it nor width is given.",
    ),
    key(
        "width",
        Shape::Curve(Length),
        Optional,
        "Distance between the left and right edges: makes the rays parallel.",
    ),
    key(
        "fixed",
        Shape::Table(FIXED),
        Optional,
        "A camera that stands.",
    ),
    key(
        "spline",
        Shape::Table(SPLINE),
        Optional,
        "A camera that moves smoothly through places.",
    ),
    key(
        "great_circle",
        Shape::Table(GREAT_CIRCLE),
        Optional,
        "A camera that flies at constant altitude and speed over a sphere.",
    ),
];

pub(crate) const FIXED: &[Key] = &[
    key("eye", Shape::Place, Required, "Where the camera stands."),
    key("target", Shape::Place, Required, "What it looks at."),
    key(
        "up",
        Shape::Place,
        Default("[0, 0, 1]"),
        "Which way is up in the image.",
    ),
];

pub(crate) const SPLINE: &[Key] = &[
    key(
        "keys",
        Shape::List(PATH_KEY),
        Required,
        "At least two places in the order of their times.",
    ),
    key(
        "up",
        Shape::Place,
        Default("[0, 0, 1]"),
        "Which way is up in the image.",
    ),
];

pub(crate) const PATH_KEY: &[Key] = &[
    key(
        "time",
        Shape::Number(Time),
        Required,
        "When, from image 0 on.",
    ),
    key("eye", Shape::Place, Required, "Where the camera is then."),
    key("target", Shape::Place, Required, "What it looks at then."),
];

pub(crate) const GREAT_CIRCLE: &[Key] = &[
    key(
        "radius",
        Shape::Number(Length),
        Optional,
        "Radius of the sphere flown over; the surface's if absent.",
    ),
    key(
        "altitude",
        Shape::Number(Length),
        Required,
        "Altitude over that sphere.",
    ),
    key(
        "speed",
        Shape::Number(Speed),
        Required,
        "Speed of the camera.",
    ),
    key(
        "latitude",
        Shape::Number(Angle),
        Default("0"),
        "Latitude at the start.",
    ),
    key(
        "longitude",
        Shape::Number(Angle),
        Default("0"),
        "Longitude at the start.",
    ),
    key(
        "heading",
        Shape::Number(Angle),
        Default("0"),
        "Heading at the start, clockwise from north.",
    ),
    key(
        "pitch",
        Shape::Curve(Angle),
        Default("0"),
        "Looking up (positive) or down from the horizontal.",
    ),
    key(
        "yaw",
        Shape::Curve(Angle),
        Default("0"),
        "Looking to the right of the heading.",
    ),
    key(
        "roll",
        Shape::Curve(Angle),
        Default("0"),
        "Leaning to the right.",
    ),
    key(
        "clearance",
        Shape::Number(Length),
        Default("0"),
        "Least height over the ground below that the path must keep.",
    ),
];

pub(crate) const SURFACE: &[Key] = &[
    key(
        "field",
        Shape::Field,
        Required,
        "The surface is where this field is 0; it is negative inside.",
    ),
    key(
        "plane",
        Shape::Table(&[]),
        Optional,
        "The terrain grows on the plane z = 0; heights are z.",
    ),
    key(
        "sphere",
        Shape::Table(SPHERE),
        Optional,
        "The terrain grows on a sphere about the origin; heights are distances from it.",
    ),
    key(
        "bound",
        Shape::Table(BOUND),
        Optional,
        "Where the surface can be; found from the field if absent.",
    ),
];

pub(crate) const SPHERE: &[Key] = &[key(
    "radius",
    Shape::Number(Length),
    Required,
    "Its radius, `R` in the field.",
)];

pub(crate) const BOUND: &[Key] = &[
    key(
        "shell",
        Shape::Range(Length),
        Optional,
        "Between these distances from the origin; the field is positive beyond.",
    ),
    key(
        "slab",
        Shape::Range(Length),
        Optional,
        "Between these heights z; the field is positive above and negative below.",
    ),
    key(
        "box",
        Shape::Table(BOX),
        Optional,
        "In a box; the surface is cut off at its faces.",
    ),
];

pub(crate) const BOX: &[Key] = &[
    key("min", Shape::Place, Required, "Least x, y and z."),
    key("max", Shape::Place, Required, "Largest x, y and z."),
];

pub(crate) const MATERIAL: &[Key] = &[
    key(
        "albedo",
        Shape::Colour,
        Default("[0.42, 0.37, 0.30]"),
        "Diffuse reflectance where no layer covers.",
    ),
    key(
        "variation",
        Shape::Field,
        Optional,
        "The reflectance is multiplied by 1 + this field.",
    ),
    key(
        "layer",
        Shape::List(LAYER),
        Optional,
        "Layers from bottom to top; each covers what lies below it.",
    ),
];

pub(crate) const LAYER: &[Key] = &[
    key(
        "albedo",
        Shape::Colour,
        Optional,
        "Diffuse reflectance; multiplied with the ramp's, if there is one.",
    ),
    key(
        "above",
        Shape::Range(Length),
        Optional,
        "Cover rises from 0 at the first height to 1 at the second.",
    ),
    key(
        "below",
        Shape::Range(Length),
        Optional,
        "Cover falls from 1 at the first height to 0 at the second.",
    ),
    key(
        "steeper",
        Shape::Range(Angle),
        Optional,
        "Cover rises from 0 to 1 between these slopes, measured from the horizontal.",
    ),
    key(
        "gentler",
        Shape::Range(Angle),
        Optional,
        "Cover falls from 1 to 0 between these slopes.",
    ),
    key(
        "cover",
        Shape::Field,
        Optional,
        "Cover is multiplied by this field, clamped to 0 ... 1.",
    ),
    key(
        "height_offset",
        Shape::Field,
        Optional,
        "Added to the height before it is compared; breaks up straight edges.",
    ),
    key(
        "ramp",
        Shape::Table(RAMP),
        Optional,
        "Colours by height from a picture.",
    ),
];

pub(crate) const RAMP: &[Key] = &[
    key(
        "file",
        Shape::File,
        Required,
        "A PNG picture beside the scene file; its first row is used, as sRGB.",
    ),
    key(
        "heights",
        Shape::Range(Length),
        Required,
        "Heights of the row's left and right ends.",
    ),
];

pub(crate) const SUN: &[Key] = &[
    key(
        "azimuth",
        Shape::Curve(Angle),
        Default("\"135 deg\""),
        "Where the sun stands, clockwise from north (+y on a plane).",
    ),
    key(
        "elevation",
        Shape::Curve(Angle),
        Default("\"35 deg\""),
        "How high it stands above the horizontal.",
    ),
    key(
        "irradiance",
        Shape::Colour,
        Default("[3.2, 3.0, 2.7]"),
        "Light on a surface that faces it, above the air.",
    ),
    key(
        "shadows",
        Shape::Flag,
        Default("true"),
        "Whether terrain shades terrain.",
    ),
    key(
        "place",
        Shape::Table(SUN_PLACE),
        Optional,
        "Whose north and horizontal count; where a great circle flight starts, or the world's axes, if absent.",
    ),
];

pub(crate) const SUN_PLACE: &[Key] = &[
    key(
        "latitude",
        Shape::Number(Angle),
        Required,
        "Latitude of the place.",
    ),
    key(
        "longitude",
        Shape::Number(Angle),
        Required,
        "Longitude of the place.",
    ),
];

pub(crate) const SKY: &[Key] = &[
    key(
        "plain",
        Shape::Table(PLAIN),
        Optional,
        "One colour and no air.",
    ),
    key(
        "air",
        Shape::Table(AIR),
        Optional,
        "Air that scatters sunlight: blue sky, pale horizon, distance haze.",
    ),
];

pub(crate) const PLAIN: &[Key] = &[
    key(
        "radiance",
        Shape::Colour,
        Default("[0.26, 0.45, 0.79]"),
        "The background.",
    ),
    key(
        "ambient",
        Shape::Colour,
        Default("[0.35, 0.45, 0.60]"),
        "Light that every surface receives from all around.",
    ),
];

pub(crate) const AIR: &[Key] = &[
    key(
        "rayleigh",
        Shape::Number(Pure),
        Default("1"),
        "How much air scatters blue, 1 for the Earth.",
    ),
    key(
        "haze",
        Shape::Number(Pure),
        Default("1"),
        "How much haze scatters white, 1 on a clear day.",
    ),
    key(
        "visibility",
        Shape::Curve(Length),
        Default("\"50 km\""),
        "Distance at which black terrain keeps 2 % of its contrast.",
    ),
    key(
        "clouds",
        Shape::Table(CLOUDS),
        Optional,
        "A thin layer of clouds, seen from below and behind every surface.",
    ),
];

pub(crate) const CLOUDS: &[Key] = &[
    key(
        "height",
        Shape::Number(Length),
        Default("\"2 km\""),
        "Height of the layer over the plane or sphere of the surface.",
    ),
    key(
        "thickness",
        Shape::Number(Length),
        Default("\"150 m\""),
        "How far light goes through them: how softly they shade themselves.",
    ),
    key(
        "depth",
        Shape::Field,
        Required,
        "Their optical depth along the vertical, by place; where it is not above 0 there are none.",
    ),
];
