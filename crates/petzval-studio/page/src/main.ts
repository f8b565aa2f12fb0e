import { mount } from "svelte";
import "uplot/dist/uPlot.min.css";
import "./app.css";
import App from "./App.svelte";

// The token has done its work: it stands in the cookie, and need not stand in the history.
if (location.search.includes("token=")) history.replaceState(null, "", location.pathname);

mount(App, { target: document.getElementById("app")! });
