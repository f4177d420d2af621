//! One order for the nodes of a scene's graph, so that equal scenes have equal bytes.

use field::{Graph, NodeId};

use crate::description::{Clouds, Description, Sky};

impl Description {
    /// Every field that something refers to, in a fixed order.
    pub fn roots(&self) -> Vec<NodeId> {
        let material = &self.surface.material;
        let layers = material
            .layers
            .iter()
            .flat_map(|layer| [layer.cover, layer.height_offset]);
        let clouds = self.sky.clouds().map(|clouds| clouds.depth);
        [Some(self.surface.field), material.variation]
            .into_iter()
            .chain(layers)
            .chain([clouds])
            .flatten()
            .collect()
    }

    fn for_each_root(&mut self, mut change: impl FnMut(&mut NodeId)) {
        change(&mut self.surface.field);
        let material = &mut self.surface.material;
        material.variation.iter_mut().for_each(&mut change);
        for layer in &mut material.layers {
            layer.cover.iter_mut().for_each(&mut change);
            layer.height_offset.iter_mut().for_each(&mut change);
        }
        if let Sky::Air {
            clouds: Some(clouds),
            ..
        } = &mut self.sky
        {
            change(&mut clouds.depth);
        }
    }
}

impl Sky {
    /// The clouds, if there are any.
    pub fn clouds(&self) -> Option<&Clouds> {
        match self {
            Self::Air { clouds, .. } => clouds.as_ref(),
            Self::Plain { .. } => None,
        }
    }
}

impl Description {
    /// The same scene without nodes that no field needs, the others in the order in which a walk
    /// from the roots, arguments first, leaves them.
    ///
    /// Every root must be a node of the graph ([`crate::rules`] checks it).
    pub fn canonical(mut self) -> Self {
        let (graph, places) = reorder(&self.surface.graph, &self.roots());
        self.surface.graph = graph;
        self.for_each_root(|root| {
            *root = places[root.index()].expect("the walk started from every root");
        });
        self
    }

    /// Whether the nodes already are in canonical order.
    pub(crate) fn is_canonical(&self) -> bool {
        let (graph, places) = reorder(&self.surface.graph, &self.roots());
        graph == self.surface.graph
            && places
                .iter()
                .enumerate()
                .all(|(index, place)| place.is_some_and(|id| id.index() == index))
    }
}

/// The nodes that the roots need, arguments before their users, and where each went.
fn reorder(graph: &Graph, roots: &[NodeId]) -> (Graph, Vec<Option<NodeId>>) {
    let mut ordered = Graph::new();
    for (file, samples) in graph.files() {
        ordered.attach(*file, samples.clone());
    }
    let mut places: Vec<Option<NodeId>> = vec![None; graph.nodes().len()];
    for &root in roots {
        // A node leaves the stack once all its arguments have left it.
        let mut stack = vec![(root, 0)];
        while let Some(top) = stack.last_mut() {
            let (id, next) = *top;
            let node = &graph.nodes()[id.index()];
            if places[id.index()].is_some() {
                stack.pop();
            } else if let Some(&arg) = node.args.get(next) {
                top.1 += 1;
                if places[arg.index()].is_none() {
                    stack.push((arg, 0));
                }
            } else {
                let args: Vec<_> = node
                    .args
                    .iter()
                    .map(|arg| places[arg.index()].expect("arguments leave first"))
                    .collect();
                let place = ordered
                    .push(node.op, &args, &node.params)
                    .expect("what one graph accepted another does");
                places[id.index()] = Some(place);
                stack.pop();
            }
        }
    }
    (ordered, places)
}
