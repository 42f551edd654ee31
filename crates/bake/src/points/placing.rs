//! From a scene to its points: where it is looked from, how far apart points are, and the points as the file will hold them.

use crate::error::BakeError;
use crate::memory;
use crate::params::Omittable;
use crate::points::candidates::Candidate;
use crate::points::coverage::everywhere;
use crate::points::known_lamps;
use crate::points::openness::Openness;
use crate::points::poisson::{self, PointLevels};
use crate::points::reflectances::cell_reflectances;
use crate::points::relevance::Relevance;
use crate::points::seen;
use crate::points::viewpoints::{self, OpenSpace};
use crate::progress::{Progress, Watch};
use crate::request::Request;
use crate::settings;
use crate::units::Units;
use glam::Vec3;
use relight_format as format;
use relight_scene::camera::{Camera, CameraTrack};
use relight_scene::surface::Surfaces;
use relight_scene::traced::TracedScene;
use relight_transport::basis::NearestPoint;

/// Candidates until all levels are full, for each point that is expected: 15 to 31 on the scenes of docs/notebook/reliability.md.
/// For progress only.
const CANDIDATES_PER_POINT: u64 = 22;

/// The scene, ready for rays.
///
/// # Errors
/// A parameter out of range, a scene that contradicts itself, or a stop.
pub(crate) fn load(request: &Request, progress: &dyn Progress) -> Result<TracedScene, BakeError> {
    settings::validate(request.params)?;
    let watch = Watch(progress);
    watch.go_on()?;
    progress.stage("load", None);
    let traced = TracedScene::new(request.scene.clone(), request.shading)?;
    watch.go_on()?;
    Ok(traced)
}

/// Levels for which an automatic coarse radius is chosen, whatever their number in a bake: fewer levels are to
/// make a bake coarser, not to spread the same points over them.
const RADIUS_LEVELS: usize = 6;

/// The scene prepared, and R of the coarsest level: what is asked for, or what suits the scene.
///
/// # Errors
/// As [`bake()`](crate::bake::bake()), more points than the machine's memory holds among them.
pub fn coarse_radius(request: &Request, progress: &dyn Progress) -> Result<(TracedScene, f32), BakeError> {
    let traced = load(request, progress)?;
    check_memory(&traced, request)?;
    let OpenSpace { places, within, .. } = chosen_viewpoints(&traced, request)?;
    let cameras = known_cameras(request);
    let relevance = Relevance::of(&traced, &places, within, cameras, request.params.seed);
    let radius = radius(&traced, request, &relevance, Units::none())?.0;
    Ok((traced, radius))
}

/// Points per level, coarsest first, that a bake has.
///
/// # Errors
/// As [`bake()`](crate::bake::bake()).
pub fn point_counts(
    surfaces: &dyn Surfaces,
    request: &Request,
    progress: &dyn Progress,
) -> Result<Vec<usize>, BakeError> {
    let placed = spread(surfaces, request, Units::none(), progress)?;
    Ok(placed
        .points
        .levels
        .iter()
        .map(|level| level.points.len())
        .collect())
}

/// The points of a bake and who will look at them.
pub struct Placed<'a> {
    /// The points as they go into the file.
    pub levels: Vec<format::Level>,
    /// The same as a reader of the file will see them: the operators are built over those.
    pub points: PointLevels,
    /// Where importance started and light is carried to, and how finely places are to be known.
    pub relevance: Relevance,
    /// A few of those places, of a scene that had no cameras of its own; none where it had.
    pub found: Vec<Vec3>,
    /// The cameras that alone will look; none: anybody may look from anywhere.
    pub tracks: Vec<&'a CameraTrack>,
    /// Where they stand over all frames.
    pub cameras: Vec<Camera>,
    /// Rays cast to choose viewpoints and radius.
    pub rays: u64,
}

/// Finds the viewpoints and spreads the points. `surfaces` are those of `traced`.
///
/// # Errors
/// Nothing is reachable, more points than the machine's memory holds, no camera for `cameras_only`, or a stop.
pub fn placed<'a>(
    traced: &TracedScene,
    surfaces: &dyn Surfaces,
    request: &'a Request,
    units: Units,
    progress: &dyn Progress,
) -> Result<Placed<'a>, BakeError> {
    let params = request.params;
    progress.expects_points(check_memory(traced, request)?);
    let Spread {
        mut points,
        relevance,
        found,
        rays,
    } = spread(surfaces, request, units, progress)?;
    if params.keeps(Omittable::Points) {
        points = everywhere(traced, points, &relevance, params.seed);
    }
    let (tracks, cameras) = looking(request)?;
    let (levels, points) = quantised(points);
    Ok(Placed {
        levels,
        points,
        relevance,
        found,
        tracks,
        cameras,
        rays,
    })
}

/// Whether the points that settings ask for fit into the machine's memory, before there are any; how many they are at most, about.
fn check_memory(traced: &TracedScene, request: &Request) -> Result<f64, BakeError> {
    let params = request.params;
    // What a radius of our own gives, whatever the scene.
    let automatic = f64::from(poisson::expected(RADIUS_LEVELS, params.levels));
    let Some(radius) = params.coarse_radius else {
        return memory::check(automatic, request);
    };
    let finest = f64::from(radius) * 0.5f64.powi(params.levels as i32 - 1);
    let triangles = 0..traced.triangle_count() as u32;
    let area: f64 = triangles.map(|t| f64::from(traced.triangle_area(t))).sum();
    if let Ok(points) = memory::check(2.0 * area * poisson::DENSITY / (finest * finest), request) {
        return Ok(points);
    }
    // Not all of it may be reached.
    let OpenSpace { places, within, .. } = chosen_viewpoints(traced, request)?;
    let relevance = Relevance::of(traced, &places, within, known_cameras(request), params.seed);
    let (own, _) = poisson::coarse_radius_for(traced, &relevance, RADIUS_LEVELS, params.seed, Units::none())?;
    memory::check(automatic * (f64::from(own) / f64::from(radius)).powi(2), request)
}

struct Spread {
    points: PointLevels,
    relevance: Relevance,
    found: Vec<Vec3>,
    rays: u64,
}

/// Where it is looked from and what at; of a scene without cameras of its own, `viewpoints` and `rays` tell how it was found.
fn chosen_viewpoints(surfaces: &dyn Surfaces, request: &Request) -> Result<OpenSpace, BakeError> {
    let mut places = viewpoints::of_cameras(&request.scene, request.lights);
    places.extend(&request.params.viewpoints);
    let chosen = match surfaces.bounds() {
        Some(bounds) if places.is_empty() => {
            let focus = viewpoints::focus(&request.scene, bounds);
            viewpoints::in_open_space(surfaces, focus, request.params.seed)
        }
        bounds => OpenSpace {
            places,
            within: bounds
                .and_then(|bounds| viewpoints::most(&request.scene, bounds))
                .map(viewpoints::with_margin),
            ..OpenSpace::default()
        },
    };
    if chosen.places.is_empty() {
        return Err(BakeError::NothingReachable {
            viewpoints: chosen.places,
        });
    }
    Ok(chosen)
}

/// Cameras of the scene and of the sequence over all frames.
fn known_cameras(request: &Request) -> Vec<Camera> {
    let (scene, lights) = (&request.scene, request.lights);
    let mut cameras = seen::poses(
        &viewpoints::tracks(scene, lights),
        viewpoints::frames(scene, lights),
    );
    cameras.retain(|camera| camera.position.is_finite());
    cameras
}

/// R of the coarsest level, and rays cast to find it.
fn radius(
    surfaces: &dyn Surfaces,
    request: &Request,
    relevance: &Relevance,
    units: Units,
) -> Result<(f32, u64), BakeError> {
    let levels = RADIUS_LEVELS;
    let (radius, rays) = match request.params.coarse_radius {
        Some(radius) => (radius, 0),
        None => poisson::coarse_radius_for(surfaces, relevance, levels, request.params.seed, units)?,
    };
    if radius.is_finite() && radius > 0.0 {
        Ok((radius, rays))
    } else {
        Err(BakeError::NothingReachable {
            viewpoints: relevance.viewpoints.clone(),
        })
    }
}

fn spread(
    surfaces: &dyn Surfaces,
    request: &Request,
    units: Units,
    progress: &dyn Progress,
) -> Result<Spread, BakeError> {
    progress.stage("reach", None);
    let (params, watch) = (request.params, Watch(progress));
    let OpenSpace {
        viewpoints: found,
        places,
        within,
        mut rays,
    } = chosen_viewpoints(surfaces, request)?;
    watch.go_on()?;
    let relevance = Relevance::of(surfaces, &places, within, known_cameras(request), params.seed);
    let (radius, cast) = radius(surfaces, request, &relevance, units)?;
    rays += cast + relevance.rays;
    // Radii of our own make give about as many points as were wanted.
    let finest = poisson::expected(RADIUS_LEVELS, params.levels) as u64;
    let wanted = params
        .coarse_radius
        .is_none()
        .then_some(finest * CANDIDATES_PER_POINT);
    progress.stage("points", wanted);
    let mut told = 0;
    // Visibility cuts have a site at each finest point, and edges of shadows lie anywhere.
    let openness = match request.uses_cuts() {
        true => Openness::none(),
        false => {
            let lamps = known_lamps::places(&request.scene, request.lights);
            Openness::new(params.levels, radius, lamps, params.seed)
        }
    };
    let points = poisson::distribute(
        surfaces,
        &relevance,
        openness,
        params.levels,
        radius,
        params.seed,
        units,
        |spread| {
            let new = spread.candidates() - told;
            told = spread.candidates();
            if let Some(wanted) = wanted {
                // It is not done yet, whatever was expected.
                progress.expect(wanted.max(told + told / 8));
            }
            watch.step(new)
        },
    )?;
    Ok(Spread {
        points,
        relevance,
        rays,
        found,
    })
}

/// The points as a reader of the file will see them: the operators are built over those. Places keep where
/// their rays start, and their exact geometric normals.
fn quantised(mut points: PointLevels) -> (Vec<format::Level>, PointLevels) {
    let mut levels = Vec::with_capacity(points.levels.len());
    for level in &mut points.levels {
        let exact = format::Level {
            disk_radius: level.disk_radius,
            support_radius: level.support_radius,
            positions: level.points.iter().map(|p| p.position.to_array()).collect(),
            normals: level.points.iter().map(|p| p.normal.to_array()).collect(),
            albedo: level
                .points
                .iter()
                .map(|p| p.albedo.clamp(Vec3::ZERO, Vec3::ONE).to_array())
                .collect(),
            widenings: level.widenings(),
        };
        let stored = format::quantised_level(&exact);
        for (i, place) in level.points.iter_mut().enumerate() {
            *place = Candidate {
                position: stored.positions[i].into(),
                normal: stored.normals[i].into(),
                albedo: stored.albedo[i].into(),
                ..*place
            };
        }
        levels.push(exact);
    }
    (levels, points)
}

/// Lets the finest of `points` reflect what their cells do in the mean, as a reader of the file will see it. `near_separated`:
/// [`Separations::near`](crate::points::separation::Separations::near). Returns the number of rays cast.
///
/// # Errors
/// A stop.
pub fn reflect_as_cells(
    surfaces: &dyn Surfaces,
    placed: &mut Placed,
    points: &mut PointLevels,
    near_separated: &[bool],
    seed: u64,
    progress: &dyn Progress,
) -> Result<u64, BakeError> {
    let levels = poisson::levels_of(points);
    let (Some(stored), Some(finest), Some(level)) =
        (placed.levels.last_mut(), points.levels.last_mut(), levels.last())
    else {
        return Ok(0);
    };
    let (reflectances, rays) = cell_reflectances(
        surfaces,
        &NearestPoint::new(level),
        near_separated,
        &placed.relevance,
        finest.points.iter().map(|point| point.albedo),
        seed,
        || Watch(progress).go_on(),
    )?;
    stored.albedo = reflectances.iter().map(|albedo| albedo.to_array()).collect();
    let read = format::quantised_level(stored).albedo;
    for (point, albedo) in finest.points.iter_mut().zip(read) {
        point.albedo = albedo.into();
    }
    Ok(rays)
}

/// The cameras that alone will look, and where they stand over all frames; none: anybody may look from anywhere.
fn looking<'a>(request: &'a Request) -> Result<(Vec<&'a CameraTrack>, Vec<Camera>), BakeError> {
    let (scene, lights) = (&request.scene, request.lights);
    if !request.params.cameras_only {
        return Ok((Vec::new(), Vec::new()));
    }
    let tracks = viewpoints::tracks(scene, lights);
    if tracks.is_empty() {
        return Err(BakeError::Parameter {
            name: "--cameras-only",
            found: "a scene without a camera".into(),
            expected: "a camera in the scene or in the sequence of --lights",
        });
    }
    let cameras = seen::poses(&tracks, viewpoints::frames(scene, lights));
    Ok((tracks, cameras))
}
